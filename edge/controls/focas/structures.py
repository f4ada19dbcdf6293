"""Structures of the FOCAS library, as its public header fwlib32.h has them. Its `long` has 32 bits on every platform."""

from ctypes import Structure, c_char, c_int16, c_int32, c_uint8, c_uint16

MAX_AXIS = 32


class OdbSys(Structure):
    """cnc_sysinfo"""

    _fields_ = (
        ("addinfo", c_int16),
        ("max_axis", c_int16),
        ("cnc_type", c_char * 2),
        ("mt_type", c_char * 2),
        ("series", c_char * 4),
        ("version", c_char * 4),
        ("axes", c_char * 2),
    )


class OdbSt(Structure):
    """cnc_statinfo; the first two are dummies on the older series."""

    _fields_ = tuple((name, c_int16) for name in ("hdck", "tmmode", "aut", "run", "motion", "mstb", "emergency", "alarm", "edit"))


class OdbDy2(Structure):
    """cnc_rddynamic2 of one axis"""

    _fields_ = (
        ("dummy", c_int16),
        ("axis", c_int16),
        *((name, c_int32) for name in ("alarm", "prgnum", "prgmnum", "seqnum", "actf", "acts")),
        *((name, c_int32) for name in ("absolute", "machine", "relative", "distance")),
    )


class SpeedElm(Structure):
    """One speed of cnc_rdspeed"""

    _fields_ = (
        ("data", c_int32),
        ("dec", c_int16),
        ("unit", c_int16),
        ("disp", c_int16),
        ("name", c_char),
        ("suff", c_char),
    )


class OdbSpeed(Structure):
    """cnc_rdspeed"""

    _fields_ = (("actf", SpeedElm), ("acts", SpeedElm))


class LoadElm(Structure):
    """One load meter: cnc_rdsvmeter gives one for each axis"""

    _fields_ = (
        ("data", c_int32),
        ("dec", c_int16),
        ("unit", c_int16),
        ("name", c_char),
        ("suff1", c_char),
        ("suff2", c_char),
        ("reserve", c_char),
    )


class OdbSpLoad(Structure):
    """cnc_rdspmeter: load and speed of one spindle"""

    _fields_ = (("spload", LoadElm), ("spspeed", LoadElm))


class OdbAct2(Structure):
    """cnc_acts2"""

    _fields_ = (("datano", c_int16), ("type", c_int16), ("data", c_int32 * MAX_AXIS))


class OdbAct(Structure):
    """cnc_acts"""

    _fields_ = (("dummy", c_int16 * 2), ("data", c_int32))


class OdbAlmMsg2(Structure):
    """cnc_rdalmmsg2"""

    _fields_ = (
        ("alm_no", c_int32),
        ("type", c_int16),
        ("axis", c_int16),
        ("dummy", c_int16),
        ("msg_len", c_int16),
        ("alm_msg", c_char * 64),
    )


class OdbExePrg(Structure):
    """cnc_exeprgname"""

    _fields_ = (("name", c_char * 36), ("o_num", c_int32))


class OdbMdl(Structure):
    """cnc_modal of an auxiliary datum, with room for what the other kinds need"""

    _fields_ = (
        ("datano", c_int16),
        ("type", c_int16),
        ("aux_data", c_int32),
        ("flag1", c_char),
        ("flag2", c_char),
        ("room", c_char * 512),
    )


class OdbGcd(Structure):
    """cnc_rdgcode"""

    _fields_ = (("group", c_int16), ("flag", c_int16), ("code", c_char * 8))


class OdbTLife4(Structure):
    """cnc_toolnum"""

    _fields_ = (("datano", c_int16), ("type", c_int16), ("data", c_int32))


class OdbTOfs(Structure):
    """cnc_rdtofs"""

    _fields_ = (("datano", c_int16), ("type", c_int16), ("data", c_int32))


class OdbMacro(Structure):
    """cnc_rdmacro: value and its decimals; -1 decimals and 0 is a vacant variable"""

    _fields_ = (("datano", c_int16), ("dummy", c_int16), ("mcr_val", c_int32), ("dec_val", c_int16))


class OpMsg(Structure):
    """cnc_rdopmsg of one message; the number -1 is none"""

    _fields_ = (("datano", c_int16), ("type", c_int16), ("char_num", c_int16), ("data", c_char * 256))


class PrgDir3(Structure):
    """cnc_rdprogdir3 of one program"""

    _fields_ = (
        ("number", c_int32),
        ("length", c_int32),
        ("page", c_int32),
        ("comment", c_char * 52),
        ("mdate", c_int16 * 6),
        ("cdate", c_int16 * 6),
    )


class OdbUseGr(Structure):
    """cnc_rdusegrpid: tool groups, the next one, the one in use, the selected one"""

    _fields_ = (("datano", c_int16), ("type", c_int16), ("next", c_int32), ("use", c_int32), ("slct", c_int32))


class AlmHis(Structure):
    """One entry of cnc_rdalmhistry; the year has two digits"""

    _fields_ = (
        ("dummy", c_int16),
        ("alm_grp", c_int16),
        ("alm_no", c_int16),
        *((name, c_uint8) for name in ("axis_no", "year", "month", "day", "hour", "minute", "second", "dummy2")),
        ("len_msg", c_int16),
        ("alm_msg", c_char * 32),
    )


class OdbAHis(Structure):
    """cnc_rdalmhistry of up to ten entries"""

    _fields_ = (("s_no", c_uint16), ("type", c_int16), ("e_no", c_uint16), ("alm_his", AlmHis * 10))


class IodbTimer(Structure):
    """cnc_gettimer: year, month and day for type 0; hour, minute and second for type 1"""

    _fields_ = (("type", c_int16), ("dummy", c_int16), ("words", c_int16 * 3))


class AxisName(Structure):
    """cnc_rdaxisname"""

    _fields_ = (("name", c_char), ("suff", c_char))


class IodbPmc(Structure):
    """pmc_rdpmcrng of bytes"""

    _fields_ = (
        ("type_a", c_int16),
        ("type_d", c_int16),
        ("datano_s", c_int16),
        ("datano_e", c_int16),
        ("cdata", c_char * 64),
    )
