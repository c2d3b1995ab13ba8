"""Constants that several stages share: grey levels, sides of blocks and cells, states."""

GREY_MAX = 65535  # grey of v = 1
GREY_LEVELS = GREY_MAX + 1

BLOCK = 64  # pixels: the largest block of the division; tiles are multiples of it
CELL = 8  # pixels: the smallest block
CELLS = BLOCK // CELL  # cells along the side of a block

FREE, UNKNOWN, OCCUPIED = 1, 2, 3  # states of an occupancy map; 0 is no data
STATES = "state: 1 free, 2 unknown, 3 occupied"  # description of a band of states
MAX_PIXEL_CLASSES = 127  # kinds of pixels that are refined together, in seven bits
