"""What is not read is named with its line and its word, never passed over."""

import pytest

from tests.twin.programs.sinumerik.reading import TOOLS, run
from twin.errors import PartProgramError


@pytest.mark.parametrize(
    ("block", "word", "reason"),
    [
        ("BSPLINE X1", "BSPLINE", "splines are not read"),
        ("ASPLINE", "ASPLINE", "splines are not read"),
        ("TRAORI", "TRAORI", "no kinematics"),
        ("TRAORI(1)", "TRAORI", "no kinematics"),
        ("ORIWKS", "ORIWKS", "no kinematics"),
        ("G1 X1 A3=0 B3=0 C3=1", "A3", "no kinematics"),
        ("CYCLE800(1)", "CYCLE800 _FR", "no kinematics"),
        ('CYCLE800(0,"TC1",100000,57,0,0,0,0,30,0,0,0,0,-1)', "CYCLE800", "no kinematics"),
        ("CYCLE79(10,0,1,-5)", "CYCLE79", "polygons"),
        ("CYCLE90(10,0,1,-5)", "CYCLE90", "thread milling"),
        ("CYCLE61(50,1,1,0,0,0,100,100,2,80,0,500,31,0,1,10)", "CYCLE61", "write CYCLE71"),
        ('CYCLE72("CONTOUR",10,0,1,-5)', "CYCLE72", "contour milling"),
        ("CYCLE95(1)", "CYCLE95", "lathe"),
        ("$P_UIFR[1]=CTRANS(X,10)", "$P_UIFR", "frames in variables are not read"),
        ("$P_PFRAME=CTRANS(X,10)", "$P_PFRAME", "frames in variables are not read"),
        ("G291", "G291", "ISO dialect"),
        ("ROTS X10 Y20", "ROTS", "spatial angles"),
        ("G34 Z-5 K1 F0.1", "G34", "changing lead"),
        ("G147 X1", "G147", "soft approach"),
        ("G58 X1", "G58", "write TRANS"),
        ("WHEN $A_IN[1]==1 DO M3", "WHEN", "synchronised actions"),
        ("ID=1 WHENEVER TRUE DO M3", "ID", "synchronised actions"),
        ("MEAS=1 X5", "MEAS", "signal"),
        ("POS[X]=5", "POS", "positioning axes"),
        ("S2=500", "S2=500", "one spindle"),
        ("M2=3", "M2=3", "one spindle"),
        ("M88", "M88", "builder_m_codes"),
        ("G999", "G999", "no such subprogram, cycle or G code"),
        ("G20", "G20", "no such subprogram, cycle or G code"),
        ("NOSUCH", "NOSUCH", "no such subprogram"),
        ("SUB1 M8", "M8", "stands beside the call of SUB1"),
        ("CYCLE81(10,0,1,-5) M9", "M9", "stands beside the call of CYCLE81"),
        ("NOSUCH(1,2)", "NOSUCH", "no such subprogram"),
        ("MCALL NOSUCH", "NOSUCH", "no such subprogram"),
        ("Q5", "Q5", "has no meaning"),
        ("G1 A5", "A5", "no axis A"),
        ("X=NOSUCH", "NOSUCH", "not known"),
        ("X=$AC_TIME", "$AC_TIME", "not known here"),
        ("R1=1==1==1", "==", "needs brackets"),
        ("IF R1==1 AND R2==2 GOTOF NEXT", "==", "needs brackets"),
        ("GOTOF NOWHERE", "NOWHERE", "no such label in this program from here to the end"),
        ("ENDIF", "ENDIF", "not whole"),
        ("LOOP", "LOOP", "not whole"),
        ("X1 X2", "X2", "twice"),
        ("G1 G0 X1", "G0", "cannot stand in one block"),
        ("X=1/0", "/", "division by zero"),
        ("X=SQRT(-1)", "SQRT", "no value at -1"),
        ("X=1+", "+", "something has to follow"),
        ("X=(1", "1", "something has to follow"),
        ('MSG("A', '"A', "no end"),
        ("X=§", "§", "no meaning"),
        ("DEF REAL A=1", "A", "begins with two letters"),
        ("DEF FRAME FRM", "FRAME", "type is not read"),
        ("DEF REAL AA[3]\nX=AA[3]", "AA", "from 0 to 2"),
        ("R1=5 MCALL", "MCALL", "no such subprogram"),
        ("G2 X10 Y0", "G2", "needs I, J, K"),
        ("G2 X10 CR=1", "CR=1", "more than the diameter"),
        ("G2 X10 Y0 I3 J0", "G2", "from its centre"),
        ("CIP X10 Y0", "CIP", "intermediate point"),
        ("CT X10 Y0", "CT", "needs a motion"),
        ("G1 X5 ANG=90", "ANG=90", "does not change X"),
        ("G1 X5 Y5 ANG=90", "ANG=90", "leave one out"),
        ("G4", "G4", "needs its time"),
        ("G33 Z-5", "G33", "needs the lead"),
        ("G1 X5 F0", "", "no feed"),
        ("SCALE X0", "X0", "a scale is from"),
        ("G75 FP=1 X1=0", "FP", "not known"),
        ("G75 X1=0", "X1=0", "SUPA G0"),
        ('T="MILL"', 'T="MILL"', "tool_numbers"),
        ("T99 M6", "M6", "no tool 99"),
        ("T1 M6\nD2", "D2", "one edge a tool"),
        ("M6", "M6", "no tool was chosen"),
        ("T1\nG1 X5 F100", "", "write M6"),
        ("G41 G1 X5 F100", "G41", "write T and M6"),
        ("OVR=50", "OVR=50", "only 100 %"),
        ("G450 DISC=50", "DISC=50", "only DISC=0"),
        ("CYCLE81(10,0,2,-5) G1 X50", "G1", "a call has a block of its own"),
        ("CYCLE81(10,0,2,-5) S5000", "S5000", "a call has a block of its own"),
        ("CYCLE81(10,0,2)", "CYCLE81 DP", "the depth"),
        ("CYCLE81(10,0,2,5)", "CYCLE81 DP", "61101"),
        ("CYCLE81(10,10,2,,5)", "CYCLE81 DPR", "61101"),
        ("CYCLE81(1,2,3,4,5,6,7,8,9,10)", "CYCLE81", "takes 9 arguments"),
        ("CYCLE83(10,0,2,-20,,-30)", "CYCLE83 FDEP", "61107"),
        ("CYCLE83(10,0,2,-20,,,10,-0.1)", "CYCLE83", "_MDEP"),
        ("CYCLE84(10,0,2,-20,,,3)", "CYCLE84 PIT", "is needed"),
        ("CYCLE84(10,0,2,-20,,,3,7)", "CYCLE84 MPIT", "M7 is no regular thread"),
        ("S500 M3\nPOCKET3(10,0,1,-5,60,40,8,0,0,0,2,0,0,500,100,0,11)", "POCKET3", "no tool|radius"),
    ],
)
def test_a_word_that_is_not_read_is_named(block: str, word: str, reason: str) -> None:
    settings = TOOLS
    text = f"G17\n{block}\nX7 Y7\nNEXT:"
    with pytest.raises(PartProgramError, match=reason) as caught:
        run(text, settings)
    assert word in caught.value.word
    assert caught.value.line >= 2


def test_a_frame_element_is_a_figure_like_any_other() -> None:
    assert run("$P_UIFR[1,X,TR]=10\nG54\nG0 X=$P_UIFR[1,X,TR]")[0][1] == (20.0, 0.0, 0.0)
