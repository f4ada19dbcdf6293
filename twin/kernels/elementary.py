"""exp and sin written out, so that a loop over lanes stays a loop over vectors.

A call of the C library's exp or sin inside a loop keeps the compiler from working on several lanes at once. These are plain
arithmetic without a branch and without a division, good to an absolute error of 3e-14 where they are used, and the same bits in
Python and in a kernel.
"""


def exp_of_minus(y: float) -> float:
    """exp(−y) for y ≥ 0: Taylor's series of exp(−y/128) to the sixth power, then squared seven times (argument reduction).

    The series is summed by Estrin's scheme, which keeps the chain of operations that wait for each other short. Beyond y = 40 the
    result is below 1e-17 and taken as that of 40.

    >>> round(exp_of_minus(1.0), 13)
    0.3678794411714
    """
    r = (y if y < 40.0 else 40.0) * -0.0078125
    s = r * r
    e = ((1.0 + r) + s * (0.5 + r * 0.16666666666666666)) + s * s * (
        (0.041666666666666664 + r * 0.008333333333333333) + s * 0.001388888888888889
    )
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


def sine_of_turns(turns: float) -> float:
    """sin(2π · turns): reduced to a quarter turn either side, then Taylor's series to the 19th power.

    >>> round(sine_of_turns(10.125), 14)
    0.70710678118655
    """
    t = turns - ((turns + 6755399441055744.0) - 6755399441055744.0)  # 1.5 · 2⁵²: the sum has no room for a fraction
    t = 0.5 - t if t > 0.25 else (-0.5 - t if t < -0.25 else t)
    x = 6.283185307179586 * t
    s = x * x
    q = s * s
    low = (1.0 + s * -0.16666666666666666) + q * (0.008333333333333333 + s * -0.0001984126984126984)
    high = (2.7557319223985893e-06 + s * -2.505210838544172e-08) + q * (
        (1.6059043836821613e-10 + s * -7.647163731819816e-13) + q * (2.8114572543455206e-15 + s * -8.22063524662433e-18)
    )
    return x * (low + q * q * high)
