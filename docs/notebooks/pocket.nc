(two passes along a block of 80 by 60 mm, 2 mm deep)
G90 G21 G17
S6000 M3
G0 X-10 Y4 Z5
Z-2
G1 X90 F900
G0 Y9
G1 X-10 F900
G0 Z5
M30
