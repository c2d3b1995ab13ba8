"""HTTP server of a folder on loopback; prints its port, then the length of each part of a file."""

import re
import sys
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any


class Ranges(SimpleHTTPRequestHandler):
    """Answers range requests, and whole files of JSON."""

    def do_GET(self) -> None:
        path = Path(self.translate_path(self.path))
        if path.suffix == ".json":
            super().do_GET()
            return
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if not path.is_file() or wanted is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        size, first, last = path.stat().st_size, int(wanted[1]), int(wanted[2])
        part = path.read_bytes()[first : last + 1]
        self.send_response(HTTPStatus.PARTIAL_CONTENT)
        self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{size}")
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)
        print(f"{len(part)}\n", end="")  # at once: other threads print, too

    def log_message(self, *_: Any) -> None:
        """No log."""


if __name__ == "__main__":
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Ranges, directory=sys.argv[1]))
    print(server.server_port)
    server.serve_forever()
