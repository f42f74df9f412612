"""A small deck of OpenFAST for tests: a cylinder on three lines with a turbine of plain figures.

No figure that the import takes is zero, one or its default where it can be another, and no two are alike."""

import numpy as np

from fowt_env.files.openfast_deck.parser import PartFile, same_key

NAMES = {
    "OpenFAST": "small.fst", "ElastoDyn": "ed.dat", "blade": "blade.dat", "tower": "tower.dat",
    "AeroDyn": "ad.dat", "AeroDyn blade": "ad_blade.dat", "polar": "Foils/one.dat", "HydroDyn": "hd.dat",
    "SeaState": "sea.dat", "MAP": "map.dat", "MoorDyn": "moor.dat", "ServoDyn": "servo.dat",
    "DISCON": "DISCON.IN", "InflowWind": "wind.dat",
}  # fmt: skip

OPENFAST = """------- OpenFAST INPUT FILE -------
a small deck
---------------------- FEATURE SWITCHES AND FLAGS ------------------------------
1    CompElast   - structural dynamics (switch)
1    CompInflow  - inflow
2    CompAero    - aerodynamics
1    CompServo   - control
1    CompSeaSt   - sea state
1    CompHydro   - hydrodynamics
0    CompSub     - substructure
1    CompMooring - mooring
0    CompIce     - ice
0    MHK         - no
---------------------- ENVIRONMENTAL CONDITIONS --------------------------------
9.81   Gravity - m/s^2
1.2    AirDens - kg/m^3
1027   WtrDens - kg/m^3
200    WtrDpth - m
0      MSL2SWL - m
---------------------- INPUT FILES ---------------------------------------------
"ED.dat"     EDFile      - letters of another case
"wind.dat"   InflowFile
".\\ad.dat"   AeroFile    - a backslash
"servo.dat"  ServoFile
"sea.dat"    SeaStFile
"hd.dat"     HydroFile
"map.dat"    MooringFile
"""

ELASTODYN = """------- ELASTODYN INPUT FILE -------
figures without meaning
True   FlapDOF1  - flap
False  TwFADOF1  - tower
False  TeetDOF   - teeter
3      NumBl     - blades
52.    TipRad    - m
2.     HubRad    - m
-3     PreCone(1) - deg
-3     PreCone(2) - deg
-3     PreCone(3) - deg
-1     HubCM     - m
0      UndSling  - m
-4.0   OverHang  - m
-5     ShftTilt  - deg
2.0    NacCMxn   - m
0.5    NacCMyn   - m
1.5    NacCMzn   - m
2.0    Twr2Shft  - m
80     TowerHt   - m
10     TowerBsHt - m
0.4    PtfmCMxt  - m
-0.3   PtfmCMyt  - m
-30    PtfmCMzt  - m
0      PtfmRefzt - m
150    TipMass(1) - kg
150    TipMass(2) - kg
150    TipMass(3) - kg
3.D4   HubMass   - kg
2.0E5  HubIner   - kg m2
500    GenIner   - kg m2
100000 NacMass   - kg
1.0E6  NacYIner  - kg m2
5000   YawBrMass - kg
6.0e6  PtfmMass  - kg
2.0e9  PtfmRIner - kg m2
2.1e9  PtfmPIner - kg m2
1.5e8  PtfmYIner - kg m2
400    BldNodes  - nodes
"blade.dat"  BldFile(1) - blade
"blade.dat"  BldFile(2) - blade
"blade.dat"  BldFile(3) - blade
98     GBoxEff   - %
90     GBRatio   - ratio
3.0E8  DTTorSpr  - N m/rad
4.0E6  DTTorDmp  - N m s/rad
False  Furling   - no
300    TwrNodes  - nodes
"tower.dat"  TwrFile - tower
"""

BLADE = """------- BLADE -------
falls to the tip
2    NBlInpSt - stations
0.5  BldFlDmp(1) - percent
0.6  BldFlDmp(2)
0.7  BldEdDmp(1)
1.2  FlStTunr(1) - factors on the stiffness of modes
1.3  FlStTunr(2)
2.0  AdjBlMs  - factor
1.5  AdjFlSt  - factor
0.8  AdjEdSt  - factor
BlFract PitchAxis StrcTwst BMassDen FlpStff EdgStff
(-) (-) (deg) (kg/m) (Nm^2) (Nm^2)
0.0 0.5 12.0 130.0 1e9 2e9
1.0 0.5 -3.0 70.0 3e8 4e8
---------------------- MODE SHAPES ---------------------------------------------
0.9     BldFl1Sh(2) - of x^2
0.5     BldFl1Sh(3) - of x^3
-0.3    BldFl1Sh(4) - of x^4
-0.2    BldFl1Sh(5) - of x^5
0.1     BldFl1Sh(6) - of x^6
-2.0    BldFl2Sh(2) - of x^2
-3.0    BldFl2Sh(3) - of x^3
1.0     BldFl2Sh(4) - of x^4
6.0     BldFl2Sh(5) - of x^5
-1.0    BldFl2Sh(6) - of x^6
0.6     BldEdgSh(2) - of x^2
0.7     BldEdgSh(3) - of x^3
-0.4    BldEdgSh(4) - of x^4
0.3     BldEdgSh(5) - of x^5
-0.2    BldEdgSh(6) - of x^6
"""

TOWER = """------- TOWER -------
falls from 3000 to 1000 kg/m
2    NTwInpSt - stations
1.0  TwrFADmp(1) - percent
2.0  TwrFADmp(2)
3.0  TwrSSDmp(1)
4.0  TwrSSDmp(2)
1.0  FAStTunr(1) - factors on the stiffness of modes
1.1  FAStTunr(2)
0.95 SSStTunr(1)
1.05 SSStTunr(2)
1.1  AdjTwMa  - factor
2.0  AdjFASt  - factor
0.9  AdjSSSt  - factor
HtFract TMassDen TwFAStif TwSSStif
(-) (kg/m) (Nm^2) (Nm^2)
0.0 3000.0 1e12 3e12
1.0 1000.0 5e11 1e12
---------------------- MODE SHAPES ---------------------------------------------
0.8     TwFAM1Sh(2) - of x^2
0.4     TwFAM1Sh(3) - of x^3
-0.1    TwFAM1Sh(4) - of x^4
-0.2    TwFAM1Sh(5) - of x^5
0.1     TwFAM1Sh(6) - of x^6
20.0    TwFAM2Sh(2) - of x^2
-10.0   TwFAM2Sh(3) - of x^3
-5.0    TwFAM2Sh(4) - of x^4
-3.0    TwFAM2Sh(5) - of x^5
-1.0    TwFAM2Sh(6) - of x^6
0.7     TwSSM1Sh(2) - of x^2
0.3     TwSSM1Sh(3) - of x^3
0.0     TwSSM1Sh(4) - of x^4
0.0     TwSSM1Sh(5) - of x^5
0.0     TwSSM1Sh(6) - of x^6
-9.0    TwSSM2Sh(2) - of x^2
4.0     TwSSM2Sh(3) - of x^3
3.0     TwSSM2Sh(4) - of x^4
2.0     TwSSM2Sh(5) - of x^5
1.0     TwSSM2Sh(6) - of x^6
"""

AERODYN = """------- AERODYN INPUT FILE -------
figures without meaning
1        Wake_Mod  - induction
0        TwrPotent - none
0        TwrShadow - none
True     TwrAero   - tower loads
"default"  AirDens - of the .fst
1        InCol_Alfa
2        InCol_Cl
3        InCol_Cd
4        InCol_Cm
1        NumAFfiles
"foils/One.dat"  AFNames - letters of another case
True     UseBlCm
"ad_blade.dat"  ADBlFile(1)
3        NumTwrNds
TwrElev TwrDiam TwrCd
(m) (m) (-)
10.0 6.0 0.7
45.0 5.6 0.4
80.0 4.0 0.6
"""

AERODYN_BLADE = """------- AERODYN BLADE -------
straight chord
4  NumBlNds - nodes
BlSpn BlCrvAC BlSwpAC BlCrvAng BlTwist BlChord BlAFID BlCb
(m) (m) (m) (deg) (deg) (m) (-) (-)
 0.0  0.0  0.0 0.0 12.0 3.0 1 0.0
10.0 -0.1  0.2 0.0  8.0 4.0 1 0.0
30.0 -0.5  0.1 0.0  3.0 2.5 1 0.0
50.0 -1.5  0.0 0.0  0.0 0.5 1 0.0
"""

POLAR = """! AirfoilInfo
"default" InterpOrd
2  NumTabs ! tables
! ---- table 1
1.0  Re
0    UserProp
False InclUAdata
3  NumAlf ! rows
! Alpha Cl Cd Cm
-180.0 0.0 0.02 0.03
   0.0 0.4 0.01 -0.05
 180.0 0.0 0.02 0.03
! ---- table 2
5.0  Re
0    UserProp
False InclUAdata
3  NumAlf ! rows
-180.0 0.0 0.03 0.02
   0.0 0.5 0.01 -0.06
 180.0 0.0 0.03 0.02
"""

HYDRODYN = """------- HydroDyn Input File -------
a cylinder, a disc below it and a column beside it
1    PotMod    - potential flow
1    ExctnMod
0    ExctnDisp
1    RdtnMod
1    NBody
1    NBodyMod
"water/float"  PotFile
2.0  WAMITULEN
0    PtfmRefxt
0    PtfmRefyt
0    PtfmRefzt
0    PtfmRefztRot
7000.0  PtfmVol0
0.1  PtfmCOBxt
-0.2 PtfmCOByt
0    MnDrift
0    NewmanApp
0    DiffQTF
0    SumQTF
1.0  AddF0 - preload
2.0
3.0
4.0
5.0
6.0
4.0e3 0 0 0 2.0e4 0 AddCLin
0 5.0e3 0 0 0 0
0 0 6.0e3 0 0 0
0 0 0 7.0e5 0 0
2.0e4 0 0 0 8.0e5 0
0 0 0 0 0 9.0e7
1.0e5 0 0 0 0 0 AddBLin
0 2.0e5 0 0 0 0
0 0 3.0e5 0 0 0
0 0 0 4.0e6 0 0
0 0 0 0 5.0e6 0
0 0 0 0 0 6.0e6
4.0e4 0 0 0 -5.0e4 0 AddBQuad
0 3.0e4 0 0 0 0
0 0 2.0e4 0 0 0
0 0 0 7.0e6 0 0
-7.0e4 0 0 0 6.0e6 0
0 0 0 0 0 5.0e6
2  NAxCoef
AxCoefID AxCd AxCa AxCp AxFDMod AxVnCOff AxFDLoFSc
(-) (-) (-) (-) (-) (-) (-)
1 0.0 0.0 1.0 0 0.0 1.0
2 8.0 0.9 0.8 0 0.0 1.0
5  NJoints
JointID Jointxi Jointyi Jointzi JointAxID JointOvrlp [of joints]
(-) (m) (m) (m) (-) (switch)
1 0.0 0.0 10.0 1 0
2 0.0 0.0 -20.0 2 0
3 0.0 0.0 -22.0 2 0
4 8.0 -6.0 4.0 1 0
5 8.0 -6.0 -16.0 1 0
4  NPropSets
PropSetID PropD PropThck
(-) (m) (m)
1 10.0 0.5 ! column
2 20.0 0.5 ! disc
3 6.0 0.25 ! column beside it, at its top
4 6.0 0.5 ! and at its foot
SimplCd SimplCdMG SimplCa SimplCaMG SimplCp SimplCpMG
(-) (-) (-) (-) (-) (-)
0.6 0.65 1.1 1.15 0.9 0.95
2  NCoefDpth
Dpth DpthCd DpthCdMG DpthCa DpthCaMG DpthCp DpthCpMG
(m) (-) (-) (-) (-) (-) (-)
0.0 0.5 0 1.2 0 0.85 0
10.0 1.5 0 1.3 0 0.75 0
1  NCoefMembers
MemberID MemberCd1 MemberCd2 MemberCa1 MemberCa2 MemberCp1 MemberCp2
(-) (-) (-) (-) (-) (-) (-)
2 2.0 3.0 0.5 0.7 0.6 0.8
3  NMembers
MemberID MJointID1 MJointID2 MPropSetID1 MPropSetID2 MDivSize MCoefMod MHstLMod PropPot [models]
(-) (-) (-) (-) (-) (m) (switch) (switch) (flag)
3 4 5 3 4 1.0 1 1 TRUE ! column beside it, from its top
1 1 2 1 1 1.0 2 1 TRUE ! column
2 2 3 2 2 1.0 3 1 FALSE ! disc
2  NFillGroups
FillNumM FillMList FillFSLoc FillDens
(-) (-) (m) (kg/m^3)
1 1 -5.0 1100.0
1 3 -7.0 1300.0
0  NMGDepths
"""

SEA = """------- SeaState Input File -------
irregular waves
"default"  WtrDens
"default"  WtrDpth
"default"  MSL2SWL
2     WaveMod
6.0   WaveHs
10.0  WaveTp
2.5        WavePkShp
15.0  WaveDir
0     CurrMod
0.3   CurrSSV0
0.2   CurrNSV0
0.1   CurrDIV
"""

MAP = """---------------------- LINE DICTIONARY ----------
LineType  Diam  MassDenInAir  EA  CB  CIntDamp  Ca  Cdn  Cdt
(-) (m) (kg/m) (N) (-) (Pa-s) (-) (-) (-)
chain  0.1  100.0  4.0E8  0.7  0 0 0 0
---------------------- NODE PROPERTIES ----------
Node Type X Y Z M B FX FY FZ
(-) (-) (m) (m) (m) (kg) (m3) (N) (N) (N)
1 fix    400 0 depth 0 0 # # #
2 Vessel   5 0 -10.0 0 0 # # #
---------------------- LINE PROPERTIES ----------
Line LineType UnstrLen NodeAnch NodeFair Flags
(-) (-) (m) (-) (-) (-)
1 chain 450.0 1 2 tension_fair
---------------------- SOLVER OPTIONS -----------
Option
(-)
repeat 240 120
"""

MOORDYN = """--------------------- MoorDyn Input File -------
----------------------- LINE TYPES -------------
Name Diam MassDen EA BA/-zeta EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s/-) (-) (-) (-) (-) (-)
chain 0.1 100.0 4.0E8 -1.0 0 2.0 0.8 0.4 0.3
---------------------- POINTS ------------------
ID Attachment X Y Z M V CdA CA
(-) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
1 Fixed   400 0 -200 0 0 0 0
2 Coupled   5 0  -10 0 0 0 0
3 Anchor -200  346.4101615 -200 0 0 0 0
4 Vessel -2.5  4.330127019  -10 0 0 0 0
5 Fixed  -200 -346.4101615 -200 0 0 0 0
6 Vessel -2.5 -4.330127019  -10 0 0 0 0
---------------------- LINES -------------------
ID LineType AttachA AttachB UnstrLen NumSegs Outputs
(-) (-) (-) (-) (m) (-) (-)
1 chain 1 2 450.0 20 -
2 chain 4 3 450.0 20 -
3 chain 5 6 450.0 20 -
---------------------- OPTIONS -----------------
0.001 dtM - step
---------------------- OUTPUTS -----------------
FairTen1
END
--------------------- need this line -----------
"""

SERVODYN = """------- SERVODYN INPUT FILE -------
ROSCO
5     PCMode
5     VSContrl
93.0  GenEff
1200  VS_RtGnSp - rpm
31000 VS_RtTq
0.02  VS_Rgn2K - N m/rpm^2
8.5   VS_SlPc
7.0   PitManRat(1)
0     NumBStC
0     YCMode
0     HSSBrMode
"libdiscon.so"  DLL_FileName
"DISCON.IN"     DLL_InFile
"""

DISCON = """! Controller parameter input file
!------- CONTROLLER FLAGS ---------
2         ! VS_ControlMode - mode
1         ! PS_Mode - shaving
0         ! PA_Mode - actuator
1.2       ! F_LPFCornerFreq - rad/s
2         ! PC_GS_n
0.1  0.2  ! PC_GS_angles
-0.01 -0.008 ! PC_GS_KP
-0.002 -0.001 ! PC_GS_KI
1.5       ! PC_MaxPit
0.0       ! PC_MinPit
0.1       ! PC_MaxRat
130.0     ! PC_RefSpd
0.02      ! PC_Switch
8.8 11.0  ! IPC_Vramp
95.0      ! VS_GenEff
12000.0   ! VS_MaxRat
33000.0   ! VS_MaxTq
45.0      ! VS_MinOMSpd
1.7       ! VS_Rgn2K
3.7e6     ! VS_RtPwr
30000.0   ! VS_RtTq
3.0 12.0 24.0 ! WE_FOPoles_v
"""

INFLOW = """------- InflowWind -------
steady
1     WindType
12.0  HWindSpeed
80.0  RefHt
0.11  PLexp
"""

ROTOR_TABLE = """# table of a rotor, which DISCON.IN may name
# Pitch angle vector (deg)
0.0 5.0
# TSR vector (-)
7.0 8.0 9.0
# Wind speed vector (m/s)
10.0
# Power coefficient
0.40 0.30
0.47 0.31
0.41 0.99
# Thrust coefficient
0.8 0.6
0.9 0.6
0.7 0.6
# Torque coefficient
0.057 0.04
0.059 0.04
0.046 0.04
"""

TEXTS = {
    "OpenFAST": OPENFAST, "ElastoDyn": ELASTODYN, "blade": BLADE, "tower": TOWER, "AeroDyn": AERODYN,
    "AeroDyn blade": AERODYN_BLADE, "polar": POLAR, "HydroDyn": HYDRODYN, "SeaState": SEA, "MAP": MAP,
    "MoorDyn": MOORDYN, "ServoDyn": SERVODYN, "DISCON": DISCON, "InflowWind": INFLOW,
}  # fmt: skip


def write_deck(folder, **changes):
    """Path of the .fst of a deck written into a folder; changes: part="text" or part=[(old, new)]."""
    changes = {name.replace("_", " "): change for name, change in changes.items()}
    for name, text in TEXTS.items():
        change = changes.pop(name, [])
        if isinstance(change, str):
            text, change = change, []
        for old, new in change:
            assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times in {name}"
            text = text.replace(old, new)
        path = folder / NAMES[name]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert not changes, changes
    write_wamit(folder / "water")
    return folder / NAMES["OpenFAST"]


def write_wamit(folder):
    """Coefficients of a body whose added mass and damping are plain functions of frequency."""
    folder.mkdir(exist_ok=True)
    pairs = [(i, i) for i in range(1, 7)] + [(1, 5), (5, 1)]
    rows = [
        f"{period} {i} {j} {0.1 * i * j * (1.0 - 0.2 * period)}" for period in (0.0, -1.0) for i, j in pairs
    ]
    excitation = []
    for omega in (0.2, 0.6, 1.0, 1.6):
        period = 2.0 * np.pi / omega
        rows += [
            f"{period} {i} {j} {0.1 * i * j + 0.1 * omega} {0.05 * i * j * omega * np.exp(-omega)}"
            for i, j in pairs
        ]
        excitation += [
            f"{period} {heading} {i} 1.0 0.0 {i * omega} {0.5 * heading / 90.0}"
            for heading in (-90.0, 0.0, 90.0)
            for i in range(1, 7)
        ]
    (folder / "float.1").write_text("\n".join(rows) + "\n")
    (folder / "float.3").write_text("\n".join(excitation) + "\n")
    stiffness = {(3, 3): 20.0, (3, 5): 1.5, (5, 3): 1.5, (4, 4): -1250.0, (5, 5): -1200.0}
    lines = [f"{i} {j} {stiffness.get((i, j), 0.0)}" for i in range(1, 7) for j in range(1, 7)]
    (folder / "float.hst").write_text("\n".join(lines) + "\n")


def set_key(path, kind, key, value):
    """Give a key of a part file another value; a new line for one that it lacks."""
    lines = path.read_text(encoding="latin-1").splitlines()
    found = PartFile(path, kind).entries.get(same_key(key))
    text = f"{value} {key} - changed"
    if found is None:
        lines.insert(2, text)
    else:
        lines[found[1]] = text
    path.write_text("\n".join(lines) + "\n", encoding="latin-1")
