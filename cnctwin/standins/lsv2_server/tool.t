BEGIN TOOL.T MM Version: 'Update:110.24'
T       NAME                            L           R           R2          DL        DR        DR2       TL RT      TIME1 TIME2 CUR_TIME TYP
0       NULLWERKZEUG                    +0          +0          +0          +0        +0        +0        0          0     0     0        9
1       MILL_D12_ROUGH                  +127.5      +6          +0          -0.01     +0.005    +0        0          60    50    18.5     9
2       SPOT_DRILL_D10                  +135        +5          +0          -0.02     +0        +0        0          0     0     3.25     1
3       DRILL_D6_8                      +142.5      +3.4        +0          -0.03     +0        +0        0          40    0     12       1
4       TAP_M8                          +150        +4          +0          -0.04     +0        +0        0          90    0     7        2
5       MILL_D12_FINISH                 +157.5      +6          +0          -0.05     +0        +0        0          60    0     2        9
[END]
