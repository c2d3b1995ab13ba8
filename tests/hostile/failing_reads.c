/* Loaded before the C library: reads of files in the folder of a case fail with EIO from one of them on.

   FAIL_AT     number of the first read that fails, from 1
   FAIL_COUNT  how many fail; 0: all that follow
   FAIL_IN     part of the paths of the files
   FAIL_LOG    a file to which the path of each failing read is appended */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

static long seen;

static int fails(int descriptor)
{
    const char *at = getenv("FAIL_AT"), *in = getenv("FAIL_IN"), *log = getenv("FAIL_LOG");
    const char *count = getenv("FAIL_COUNT");
    char link[64], path[4096];
    if (!at || !in || !log || !count)
        return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 2);
    if (length <= 0)
        return 0;
    path[length] = 0;
    if (!strstr(path, in))
        return 0;
    long number = __sync_add_and_fetch(&seen, 1), first = atol(at), last = first + atol(count);
    if (number < first || (last > first && number >= last))
        return 0;
    int to = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (to >= 0) {
        path[length] = '\n';
        if (write(to, path, length + 1) < 0)
            abort();
        close(to);
    }
    errno = EIO;
    return 1;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t read(int fd, void *to, size_t size)
{
    return fails(fd) ? -1 : NEXT(read)(fd, to, size);
}

ssize_t pread(int fd, void *to, size_t size, off_t at)
{
    return fails(fd) ? -1 : NEXT(pread)(fd, to, size, at);
}

ssize_t pread64(int fd, void *to, size_t size, off64_t at)
{
    return fails(fd) ? -1 : NEXT(pread64)(fd, to, size, at);
}

ssize_t readv(int fd, const struct iovec *to, int count)
{
    return fails(fd) ? -1 : NEXT(readv)(fd, to, count);
}

ssize_t preadv(int fd, const struct iovec *to, int count, off_t at)
{
    return fails(fd) ? -1 : NEXT(preadv)(fd, to, count, at);
}

ssize_t preadv64(int fd, const struct iovec *to, int count, off64_t at)
{
    return fails(fd) ? -1 : NEXT(preadv64)(fd, to, count, at);
}

size_t fread(void *to, size_t size, size_t count, FILE *file)
{
    if (fails(fileno(file))) {
        file->_flags |= 0x20; /* what ferror looks at, in glibc */
        return 0;
    }
    return NEXT(fread)(to, size, count, file);
}
