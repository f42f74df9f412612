"""Classifies all keys of a deck: read, without effect here, neutral at some value, or unknown.

KEYS has a table per kind of file. A key (or a column of a table) that is not listed, or that differs from its
neutral value, adds a row to the report, or raises InputError if the result would be a different machine:
`differences`. The names are those of OpenFAST's readers, from FAST 8.16 to OpenFAST 5.
"""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from fowt_env.files.openfast_deck.parser import bare, number_of, same_key, truth_of

LATE = 9000.0  # s: events at or after this time are outside all runs
UNKNOWN = "ignored: the importer does not know this key"


class Otherwise(NamedTuple):
    """Defines the effect of a key that differs from its neutral value.

    neutral    values (numbers, booleans, lower-case texts) without effect, or a predicate of the number
    deck       feature of the deck otherwise; for a refusal: the allowed value and the reason
    here       treatment here; None: such a deck is refused
    cases      {value: (deck, here)} of values with a separate meaning
    when       predicate of the file, whether the key applies; None: always
    """

    neutral: Any
    deck: str
    here: str | None
    cases: dict = {}
    when: Callable | None = None


def _names(text):
    return map(same_key, text.split())


def _keys(read, ignored, **neutral):
    """Return {normalised key ("#": final number): None if the key is read, else a reason or Otherwise}."""
    table = dict.fromkeys(_names(read))
    for reason, text in ignored.items():
        table |= dict.fromkeys(_names(text), reason)
    return table | {same_key(key): value for key, value in neutral.items()}


def known(table, key):
    """Return the form of a key in a table, or None."""
    return next((form for form in (key, re.sub(r"\d+$", "#", key)) if form in table), None)


def _all(names, value):
    """Return {key: value} of several keys with the same Otherwise."""
    return dict.fromkeys(names.split(), value)


def _blade_element_wake(file):
    """Return whether DBEMT_Mod applies in an AeroDyn file: Wake_Mod is 1."""
    return file.has("Wake_Mod") and file.whole("Wake_Mod") == 1


def _late(deck, here="no such event: faults and stops are arguments of a run"):
    return Otherwise(lambda seconds: seconds >= LATE, deck, here)


def differences(file):
    """Return a list of (feature of the deck, treatment here) of a part file whose tables have been read.

    Raises: InputError for a key whose value would define a different machine.
    """
    table, rows, unknown = KEYS[file.kind], [], set()
    entries = [(name, line, values) for name, line, values in file.entries.values()]
    entries += [
        (name, line, [f"{value:g}" if isinstance(value, float) else str(value)])
        for name, cells in file.columns.items()
        for line, value in cells
    ]
    for name, line, values in entries:
        form = known(table, same_key(name))
        value = " ".join(map(bare, values))
        if form is None:
            if same_key(name) in unknown:
                continue  # the other values of a column
            unknown.add(same_key(name))
            rows.append((f"{name} {value[:60]} ({file.kind})".replace("  ", " "), UNKNOWN))
        elif isinstance(table[form], Otherwise):
            rows += _row(file, name, line, values, table[form])
    return list(dict.fromkeys(rows))


def _row(file, name, line, values, otherwise):
    """Return [(deck, here)] of a key with an Otherwise; [] at the neutral value."""
    if otherwise.when is not None and not otherwise.when(file):
        return []
    words = [bare(word) for word in values]
    if all(_is_neutral(word.lower(), otherwise.neutral) for word in words):
        return []
    text = " ".join(words)[:60]
    if otherwise.here is None:
        raise file.refusal(f"{name} = {text}: must be {otherwise.deck}", line)
    number = number_of(words[0])
    case = words[0] if number is None else f"{number:g}"
    deck, here = otherwise.cases.get(case, (otherwise.deck, otherwise.here))
    return [(f"{deck} ({name} {text})", here)]


def _is_neutral(word, neutral):
    number, truth = number_of(word), truth_of(word)
    if callable(neutral):
        return number is not None and neutral(number)
    for value in neutral if isinstance(neutral, tuple) else (neutral,):
        if isinstance(value, bool):
            # some versions write switches as numbers
            if (truth if truth is not None else None if number is None else number != 0.0) is value:
                return True
        elif isinstance(value, str):
            if word == value:
                return True
        elif number == value or (truth is not None and float(truth) == value):
            return True
    return False


OUTPUT = "output only"
STEPS = "time steps, iterations and interpolation"
INITIAL = "initial conditions: here a run starts at the steady state of its wind"
_MODULE_OUTPUT = "Echo SumPrint OutFile TabDelim OutFmt TStart DecFact OutList"

OPENFAST = _keys(
    "CompElast CompInflow CompAero CompServo CompSeaSt CompHydro CompSub CompMooring CompIce MHK"
    " MHK_Floating NumTurbines Gravity AirDens WtrDens WtrDpth MSL2SWL EDFile InflowFile AeroFile"
    " ServoFile SeaStFile HydroFile ServoFile# EDFile# InflowFile# AeroFile# SeaStFile# HydroFile#"
    " MooringFile# MooringFile",
    {
        OUTPUT: "Echo SumPrint SttsTime ChkptTime DT_Out TStart OutFileFmt TabDelim OutFmt WrVTK VTK_type"
        " VTK_fields VTK_fps",
        STEPS: "TMax DT InterpOrder NumCrctn DT_UJac UJacSclFact ModCoupling RhoInf ConvTol MaxConvIter"
        " AbortLevel",
        "linearization, replaced by that of this project": "Linearize CalcSteady TrimCase TrimTol"
        " TrimGain Twr_Kdmp Bld_Kdmp NLinTimes LinTimes LinInputs LinOutputs LinOutJac LinOutMod",
        "fluid properties that no load here depends on": "KinVisc SpdSound Patm Pvap",
        "files of modules that a switch disables or refuses": "BDBldFile# SubFile IceFile SoilFile",
    },
    MirrorRotor=Otherwise(False, "False: a rotor with reversed rotation cannot be represented", None),
    NRotors=Otherwise(1, "1: several rotors cannot be represented", None),
    CompSoil=Otherwise(0, "0: a soil model cannot be represented", None),
)

_HELD = Otherwise(True, "", "free")
ELASTODYN = _keys(
    "NumBl TipRad HubRad PreCone# HubCM UndSling OverHang ShftTilt NacCMxn NacCMyn NacCMzn Twr2Shft"
    " TowerHt TowerBsHt PtfmCMxt PtfmCMyt PtfmCMzt PtfmRefzt PtfmRef TipMass# HubMass HubIner GenIner"
    " NacMass NacYIner YawBrMass PtfmMass PtfmRIner PtfmPIner PtfmYIner PtfmXYIner PtfmYZIner PtfmXZIner"
    " BldNodes BldFile# BldFile GBoxEff GBRatio Furling TwrNodes TwrFile Gravity TeetDOF FlapDOF1 FlapDOF2"
    " EdgeDOF DrTrDOF YawDOF TwFADOF1 TwFADOF2 TwSSDOF1 TwSSDOF2 DTTorSpr DTTorDmp",
    {
        OUTPUT: _MODULE_OUTPUT + " OutFileFmt ShftGagL NcIMUxn NcIMUyn NcIMUzn AzimB1Up NTwGages TwrGagNd"
        " NBlGages BldGagNd BldNd_BladesOut BldNd_BlOutNd BldNd_BlOutNd_Str",
        STEPS: "Method DT",
        INITIAL: "OoPDefl IPDefl BlPitch# TeetDefl Azimuth RotSpeed TTDspFA TTDspSS PtfmSurge PtfmSway"
        " PtfmHeave PtfmRoll PtfmPitch PtfmYaw",
        "teetering and furling, which are refused": "Delta3 TeetMod TeetDmpP TeetDmp TeetCDmp TeetSStP"
        " TeetHStP TeetSSSp TeetHSSp HubIner_Teeter FurlFile",
        "of a degree of freedom that is rigid here, see its row": "YawFrctMod"
        " M_CSmax M_FCSmax M_MCSmax M_CD M_FCD M_MCD sig_v sig_v2 OmgCut PBrIner# BlPIner#",
    },
    PitchDOF=Otherwise(False, "blade pitch as a degree of freedom", "the pitch drive of the turbine file"),
    NacYaw=Otherwise(0, "nacelle yawed out of the wind", "nacelle along x"),
    PtfmRefxt=Otherwise(0, "0: the origin lies on the tower axis", None),
    PtfmRefyt=Otherwise(0, "0: the origin lies on the tower axis", None),
    GenDOF=_HELD._replace(deck="fixed rotor speed", here="free: the controller's torque acts on the rotor"),
    **{
        key: _HELD._replace(deck=f"platform {motion} disabled", here="free" + more)
        for key, motion, more in (
            ("PtfmSgDOF", "surge", ""), ("PtfmHvDOF", "heave", ""), ("PtfmPDOF", "pitch", ""),
            ("PtfmSwDOF", "sway", "; the option planar holds sway, roll and yaw"),
            ("PtfmRDOF", "roll", "; the option planar holds sway, roll and yaw"),
            ("PtfmYDOF", "yaw", "; the option planar holds sway, roll and yaw"),
        )
    },
)  # fmt: skip
ELASTODYN_BLADE = _keys(
    "NBlInpSt AdjBlMs BlFract BMassDen BldFlDmp# BldEdDmp# FlStTunr# AdjFlSt AdjEdSt BldFl1Sh# BldFl2Sh#"
    " BldEdgSh# StrcTwst FlpStff EdgStff",
    {
        "columns and switches that ElastoDyn does not use": "CalcBMode GJStff EAStff Alpha FlpIner EdgIner"
        " PrecrvRef PreswpRef FlpcgOf EdgcgOf FlpEAOf EdgEAOf AeroCent PitchAxis",
    },
)  # fmt: skip
TOWER = _keys(
    "NTwInpSt TwrFADmp# TwrSSDmp# FAStTunr# SSStTunr# AdjTwMa AdjFASt AdjSSSt TwFAM1Sh# TwFAM2Sh#"
    " TwSSM1Sh# TwSSM2Sh# HtFract TMassDen TwFAStif TwSSStif",
    {
        "columns and switches that ElastoDyn does not use": "CalcTMode TwGJStif TwEAStif TwFAIner TwSSIner"
        " TwFAcgOf TwSScgOf",
    },
    NTwCMass=Otherwise(0, "0: add concentrated masses of the tower to TMassDen", None),
)

_INDUCTION = Otherwise(True, "", "included")
_QUASI_STEADY = "quasi-steady induction; dynamic with the option dynamic_inflow"
_STEADY_POLARS = "quasi-steady polars; with the option unsteady_airfoils the four-state model (UA_Mod 4)"
_SKEWED = "with the option skewed_wake the correction of Pitt and Peters, 15 pi / 32"
AERODYN = _keys(
    "NumAFfiles InCol_Alfa InCol_Cl InCol_Cd InCol_Cm UseBlCm AFTabMod AFNames ADBlFile# ADBlFile"
    " NumTwrNds AirDens TwrAero TwrPotent TwrShadow TwrElev TwrDiam TwrCd TwrTI",
    {
        OUTPUT: _MODULE_OUTPUT + " NBlOuts BlOutNd NTwOuts TwOutNd BldNd_BladesOut BldNd_BlOutNd CompAA"
        " AA_InputFile CavitCheck InCol_Cpmin",
        STEPS: "DTAero IndToler MaxIter",
        "linearization, replaced by that of this project": "FrozenWake",
        "fluid properties that no load here depends on": "KinVisc SpdSound Patm Pvap FluidDepth AddedMass",
        "of a model with a separate switch": "tau1_const OLAFInputFileName FVWFile AoA34 UAMod"
        " FLookup IntegrationMethod UAStartRad UAEndRad SectAvgWeighting SectAvgNPoints SectAvgPsiBwd"
        " SectAvgPsiFwd VolHub HubCenBx VolNac NacCenB NacArea NacCd NacDragAC TFinFile TwrCb TwrCp"
        " TwrCa TwrCpCS SkewMomCorr",
    },
    **{
        key: Otherwise(1, "another model of induction", "blade-element momentum theory", {
            "0": ("no induction", "blade-element momentum theory: induction always on"),
            "2": ("dynamic wake", _QUASI_STEADY),
            "3": ("free vortex wake", "blade-element momentum theory"),
        })
        for key in ("Wake_Mod", "WakeMod")
    },
    DBEMT_Mod=Otherwise((0, -1), "dynamic wake", _QUASI_STEADY, when=_blade_element_wake),
    UA_Mod=Otherwise(0, "unsteady airfoil aerodynamics", _STEADY_POLARS),
    AFAeroMod=Otherwise(1, "unsteady airfoil aerodynamics", _STEADY_POLARS),
    Buoyancy=Otherwise(False, "buoyancy of blades and tower", "none"),
    NacelleDrag=Otherwise(False, "drag of the nacelle", "none"),
    TFinAero=Otherwise(False, "tail fin", "none"),
    BEM_Mod=Otherwise(1, "momentum balance in a polar grid", "normal to each blade section (BEM_Mod 1)"),
    Skew_Mod=Otherwise(
        0,
        "skewed-wake correction",
        f"none; {_SKEWED}",
        cases={"-1": ("cross-flow wind removed", "included")},
    ),
    SkewMod=Otherwise(1, "skewed-wake correction", f"none; {_SKEWED}"),
    SkewRedistr_Mod=Otherwise(("default", 1), "another skewed-wake redistribution", _SKEWED),
    **_all("SkewRedistrFactor SkewModFactor",
           Otherwise("default", "another factor of the skewed wake", _SKEWED)),
    SectAvg=Otherwise(False, "wind averaged over sectors", "at each blade section"),
    TipLoss=_INDUCTION._replace(deck="no tip loss"),
    HubLoss=_INDUCTION._replace(deck="no hub loss"),
    TanInd=_INDUCTION._replace(deck="no tangential induction"),
    AIDrag=_INDUCTION._replace(deck="no drag in the axial induction"),
    TIDrag=_INDUCTION._replace(deck="no drag in the tangential induction"),
)  # fmt: skip
AERODYN_BLADE = _keys(
    "NumBlNds BlSpn BlCrvAC BlSwpAC BlTwist BlChord BlAFID",
    {
        "the slope of BlCrvAC": "BlCrvAng",
        "of a model with a separate switch": "BlCb BlCenBn BlCenBt BlCpn BlCpt BlCan BlCat BlCam t_c",
    },
)
POLAR = _keys(
    "NumAlf Re",
    {
        "counted": "NumTabs",
        STEPS: "InterpOrd",
        "coordinates and boundary layer, for pictures and noise": "NonDimArea NumCoords BL_file RelThickness",
        "choice between tables, see AFTabMod and the row of several tables": "UserProp Ctrl",
        "unsteady airfoil aerodynamics, see the row of UA_Mod or AFAeroMod": "InclUAdata alpha0 alpha1"
        " alpha2 alphaUpper alphaLower eta_e C_nalpha C_lalpha T_f0 T_V0 T_p T_VL b1 b2 b5 A1 A2 A5 S1 S2"
        " S3 S4 Cn1 Cn2 St_sh Cd0 Cm0 k0 k1 k2 k3 k1_hat x_cp_bar UACutout UACutout_delta filtCutOff",
    },
)

_DAMPER = Otherwise(0, "", "none")
SERVODYN = _keys(
    "GenEff VSContrl DLL_FileName DLL_InFile VS_RtGnSp VS_RtTq VS_Rgn2K VS_SlPc PitManRat#",
    {
        OUTPUT: _MODULE_OUTPUT + " OutFileFmt",
        STEPS: "DT DLL_DT DLL_Ramp",
        "the induction generator of VSContrl 0, which is refused": "GenModel SIG_SlPc SIG_SySp SIG_RtTq"
        " SIG_PORt TEC_Freq TEC_NPol TEC_SRes TEC_RRes TEC_VLL TEC_SLR TEC_RLR TEC_MR",
        "of a feature with a separate switch": "BlPitchF# SpdGenOn THSSBrDp HSSBrDT HSSBrTqF TYCOn"
        " YawManRat NacYawF AfC_Mean AfC_Amp AfC_Phase BStCfiles NStCfiles TStCfiles SStCfiles BStCfile"
        " NStCfile TStCfile SStCfile NTMDfile TTMDfile",
        "of a degree of freedom that is rigid here, see its row": "YawSpr YawDamp PitNeut#"
        " PitSpr# PitDamp#",
        "values passed to a controller library, not used by ROSCO": "DLL_ProcName EXavrSWAP"
        " NacYaw_North Ptch_Cntrl Ptch_SetPnt Ptch_Min Ptch_Max PtchRate_Min PtchRate_Max Gain_OM"
        " GenSpd_MinOM GenSpd_MaxOM GenSpd_Dem GenTrq_Dem GenPwr_Dem DLL_NumTrq GenSpd_TLU GenTrq_TLU",
    },
    PCMode=Otherwise(5, "pitch control not by a library", "pitch control by the controller of a run",
                     {"0": ("no pitch control", "pitch control by the controller of a run")}),
    TPCOn=Otherwise(lambda seconds: seconds <= 0.0, "delayed start of pitch control", "from the start"),
    **{f"TPitManS({i})": _late("override of the blade pitch after a time") for i in (1, 2, 3)},
    GenTiStr=Otherwise(True, "generator start by speed", "on from the start"),
    GenTiStp=Otherwise(True, "generator stop by power", "on"),
    TimGenOn=Otherwise(lambda seconds: seconds <= 0.0, "delayed start of the generator", "from the start"),
    TimGenOf=_late("generator off after a time"),
    HSSBrMode=Otherwise(0, "shaft brake", "none"),
    YCMode=Otherwise(0, "nacelle-yaw control", "the nacelle does not yaw"),
    YawNeut=Otherwise(0, "nacelle yawed out of the wind", "nacelle along x"),
    TYawManS=_late("yaw manoeuvre after a time", "the nacelle does not yaw"),
    AfCmode=Otherwise(0, "flaps or other control of airfoils", "none"),
    NumBStC=_DAMPER._replace(deck="structural controllers (tuned mass dampers) of the blades"),
    NumNStC=_DAMPER._replace(deck="structural controllers (tuned mass dampers) of the nacelle"),
    NumTStC=_DAMPER._replace(deck="structural controllers (tuned mass dampers) of the tower"),
    NumSStC=_DAMPER._replace(deck="structural controllers (tuned mass dampers) of the platform"),
    CompNTMD=Otherwise(False, "tuned mass damper of the nacelle", "none"),
    CompTTMD=Otherwise(False, "tuned mass damper of the tower", "none"),
    CCmode=Otherwise(0, "cable control", "mooring lines of constant length"),
    BPCutoff=Otherwise(lambda hertz: hertz >= 100.0, "low pass on the commanded blade pitch", "none"),
)  # fmt: skip

_LONG_WAVES = "inertia coefficients of long waves; for a spar see the option diffraction"
SEASTATE = _keys(
    "WtrDens WtrDpth MSL2SWL X_HalfWidth Y_HalfWidth Z_Depth WaveMod WaveHs WaveTp WavePkShp WvLowCOff"
    " WvHiCOff WaveDir CurrMod CurrSSV0 CurrSSDir CurrNSRef CurrNSV0 CurrNSDir CurrDIV CurrDIDir",
    {
        OUTPUT: "Echo SeaStSum OutSwtch OutFmt OutSFmt NWaveElev WaveElevxi WaveElevyi NWaveKin WaveKinxi"
        " WaveKinyi WaveKinzi",
        STEPS: "NX NY NZ WaveTMax WaveDT",
        "one realisation of a random sea": "WaveSeed# WaveNDAmp",
        "of a feature with a separate switch": "WaveDirSpread WaveNDir WaveDirRange WvKinFile WvLowCOffD"
        " WvHiCOffD WvLowCOffS WvHiCOffS CrestHmax CrestTime CrestXi CrestYi",
    },
    WaveStMod=Otherwise(0, "waves stretched to the surface", "see the options stretching and surface"),
    WaveDirMod=Otherwise(0, "short-crested waves", "long-crested waves"),
    WvDiffQTF=Otherwise(False, "second-order wave kinematics of difference frequencies", "first order"),
    WvSumQTF=Otherwise(False, "second-order wave kinematics of sum frequencies", "first order"),
    ConstWaveMod=Otherwise(0, "a constrained wave", "a random sea"),
    WvCrntMod=Otherwise(0, "waves on a current", "waves as without current"),
    MCFD=Otherwise(lambda radius: radius <= 0.0, "MacCamy-Fuchs diffraction of members", _LONG_WAVES),
)  # fmt: skip


def _potential(file):
    """Return whether a file of HydroDyn has a potential-flow body."""
    return file.whole("PotMod", default=0) == 1


_FORCE = Otherwise((True, "default"), "True: all six hydrodynamic forces", None, when=_potential)
_REFERENCE = Otherwise(
    0, "0: the coefficients must be about the tower axis at still water", None, when=_potential
)
_GROWTH = "marine growth, which is refused"
HYDRODYN = _keys(
    "PotMod PotFile WAMITULEN NBody PtfmVol0 PtfmCOBxt PtfmCOByt RdtnMod MnDrift NewmanApp DiffQTF SumQTF"
    " AddF0 AddCLin AddBLin AddBQuad NAxCoef NJoints NPropSets NPropSetsCyl NPropSetsRec NCoefDpth"
    " NCoefDpthCyl NCoefMembers NCoefMembersCyl NCoefMembersRec NMembers NFillGroups NMGDepths MGDpth"
    " MGThck AxCoefID AxCd AxCa AxCp JointID Jointxi Jointyi Jointzi JointAxID PropSetID PropD PropThck"
    " MemberID MJointID# MPropSetID# MCoefMod MHstLMod PropPot MSecGeom SimplCd SimplCa SimplCp SimplCb"
    " SimplAxCd SimplAxCa SimplAxCp Dpth DpthCd DpthCa DpthCp DpthCb DpthAxCd DpthAxCa DpthAxCp MemberCd#"
    " MemberCa# MemberCp# MemberCb# MemberAxCd# MemberAxCa# MemberAxCp#",
    {
        OUTPUT: "Echo NMOutputs NJOutputs JOutLst HDSum OutAll OutSwtch OutFmt OutSFmt",
        STEPS: "RdtnTMax RdtnDT MDivSize NBodyMod",
        _GROWTH: "MGDens SimplCdMG SimplCaMG SimplCpMG SimplAxCdMG SimplAxCaMG SimplAxCpMG SimplCbMG"
        " DpthCdMG DpthCaMG DpthCpMG DpthAxCdMG DpthAxCaMG DpthAxCpMG DpthCbMG MemberCdMG# MemberCaMG#"
        " MemberCpMG# MemberAxCdMG# MemberAxCaMG# MemberAxCpMG# MemberCbMG#",
        "rectangular members, which are refused": "NCoefDpthRec MSpinOrient FDMod VnCOffA VnCOffB FDLoFScA"
        " FDLoFScB",
        "of a feature with a separate switch": "ExctnCutOff PtfmYCutOff NExctnHdg AxVnCOff",
    },
    ExctnMod=Otherwise(1, "another wave excitation", "directly from the coefficients", {
        "0": ("no wave excitation", "wave excitation always included"),
        "2": ("state-space fit of the wave excitation", "directly from the coefficients"),
    }, when=_potential),
    ExctnDisp=Otherwise(0, "wave excitation at the displaced position",
                        "undisplaced; see the option excitation_position", when=_potential),
    PtfmYMod=Otherwise(0, "wave loads at large platform yaw", "wave loads at zero yaw"),
    NAddDOF=Otherwise(0, "0: further degrees of freedom cannot be represented", None, when=_potential),
    **_all("PtfmRefxt PtfmRefyt PtfmRefzt PtfmRefztRot PtfmRefY", _REFERENCE),
    **_all("PtfmSgF PtfmSwF PtfmHvF PtfmRF PtfmPF PtfmYF", _FORCE),
    WaveDisp=Otherwise(0, "wave kinematics at the displaced members",
                       "at the undisplaced ones; see the option kinematics_position"),
    AMMod=Otherwise(0, "added mass of members up to the wave's surface", "up to still water"),
    HstMod=Otherwise(0, "buoyancy of members up to the wave's surface", "see the option surface"),
    JointOvrlp=Otherwise(0, "overlap of members removed at joints", "members overlap there"),
    AxFDMod=Otherwise(0, "low-passed or one-sided axial drag", "axial drag of the instantaneous velocity"),
    AxFDLoFSc=Otherwise(1, "axial drag of slow motions scaled", "the same at all frequencies"),
    **_all("SimplMCF DpthMCF MemberMCF",
           Otherwise(0, "MacCamy-Fuchs diffraction of members", _LONG_WAVES)),
)  # fmt: skip


_KINDS = "of another kind of wind, or of a box or file set with --wind"
INFLOWWIND = _keys(
    "WindType HWindSpeed RefHt PLexp Filename_Uni Filename RefHt_Uni",
    {
        OUTPUT: "Echo SumPrint NWindVel WindVxiList WindVyiList WindVziList",
        STEPS: "VelInterpCubic",
        _KINDS: "RefLength FileName_BTS FilenameRoot TowerFile FileName_u FileName_v FileName_w nx ny nz"
        " dx dy dz RefHt_HAWC ScaleMethod SFx SFy SFz SigmaFx SigmaFy SigmaFz TStart TEnd URef WindProfile"
        " PLExp_HAWC Z0 XOffset CTTS_CoherentTurbFlag CTTS_FileName CTTS_Path WindFileName",
        "lidar, replaced by that of this project": "SensorType NumPulseGate"
        " PulseSpacing NumBeam FocalDistanceX FocalDistanceY FocalDistanceZ RotorApexOffsetPos URefLid"
        " MeasurementInterval LidRadialVel ConsiderHubMotion",
    },
    PropagationDir=Otherwise(
        0, "wind from another direction", "wind along x, with the heading of a wind file"
    ),
    VFlowAng=Otherwise(0, "wind inclined to the horizontal", "horizontal wind"),
)

_LINE = "line dynamics without a counterpart here, see the row"
MOORDYN = _keys(
    "g gravity rhoW rho WtrDpth depth WaterDepth Name Diam MassDen EA ID Type X Y Z M V FX FY FZ LineType"
    " AttachA AttachB UnstrLen NumSegs BA Cd CdAx CaAx kBot kB cBot cB",
    {
        OUTPUT: "Echo WriteLog WriteUnits OutSwitch dtOut DisableOutTime DisableOutput Outputs",
        STEPS: "dtM tScheme cfl dtIC TmaxIC ICDfac CdScaleIC threshIC ICgenDynamic inertialF inertialF_rampT",
        _LINE: "dF cF mc cv FricDamp",
    },
    EI=Otherwise(0, "bending stiffness of lines", "none"),
    Cl=Otherwise(0, "vortex-induced vibrations of lines", "none"),
    CdA=Otherwise(0, "drag of a point on the vessel", "none"),
    CA=Otherwise(0, "added mass of a point on the vessel", "none"),
    WaterKin=Otherwise((0, "default"), "waves and current on the lines", "none"),
    mu_kT=Otherwise(0, "friction across the lines on the bed", "none"),
    mu_kA=Otherwise(0, "friction along the lines on the bed", "none: set seabed_friction in [[lines]]"),
)
MAP = _keys(
    "repeat LineType Diam MassDenInAir EA CB Node Type X Y Z M B FX FY FZ Line UnstrLen NodeAnch NodeFair"
    " linear_spring omit_contact",
    {
        OUTPUT: "plot help gx_pos gy_pos gz_pos gx_a_pos gy_a_pos gz_a_pos gx_force gy_force gz_force h_fair"
        " h_anch v_fair v_anch h_force v_force tension_fair tension_anch x_force y_force z_force"
        " x_excursion y_excursion z_excursion azimuth altitude fair_tension anch_tension lay_length"
        " line_tension diagnostic",
        STEPS: "inner_ftol inner_gtol inner_xtol inner_max_its outer_max_its outer_tol outer_epsilon"
        " integration_dt kb_default cb_default outer_bd outer_cd outer_fd pg_cooked krylov_accelerator"
        " powell",
        _LINE: "CIntDamp Ca Cdn Cdt",
    },
    lm_model=Otherwise(False, "dynamic lines (lumped masses)", "quasi-static catenaries"),
    wave_kinematics=Otherwise(False, "waves and current on the lines", "none"),
    ref_position=Otherwise(0, "0 0 0: lines hang from the platform at its origin", None),
    damage_time=Otherwise(lambda seconds: seconds >= LATE, "line failure at a time", "no line failure"),
)

KEYS = {
    "OpenFAST": OPENFAST,
    "ElastoDyn": ELASTODYN,
    "ElastoDyn blade": ELASTODYN_BLADE,
    "tower": TOWER,
    "AeroDyn": AERODYN,
    "AeroDyn blade": AERODYN_BLADE,
    "polar": POLAR,
    "ServoDyn": SERVODYN,
    "HydroDyn": HYDRODYN | SEASTATE,  # before OpenFAST 4 the sea was defined in HydroDyn's file
    "SeaState": SEASTATE,
    "InflowWind": INFLOWWIND,
    "MoorDyn": MOORDYN,
    "MAP++": MAP,
}
