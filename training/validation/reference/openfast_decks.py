"""Writes OpenFAST v5.0.0 inputs from the public decks of VolturnUS-S, OC3-Hywind and the OC4 semi.

Decks are listed in NOTICE: IEAWindSystems/IEA-15-240-RWT ac5248a (with the DISCON.IN of NREL/ROSCO fc11f43),
old-NWTC/FAST 0badc8d with the turbine of NREL/ROSCO fc11f43. Values are transferred by key.
"""

import re
import shutil
from math import pi
from pathlib import Path

import numpy as np

OPENFAST = "OpenFAST v5.0.0 (2895884d2be01862173c88d70f86b358d2f1a50a)"
MOTIONS = ("PtfmSurge", "PtfmSway", "PtfmHeave", "PtfmRoll", "PtfmPitch", "PtfmYaw")
STARTS = ("OoPDefl", "IPDefl", "NacYaw", "Azimuth")
BLADES = (1, 2, 3)

# keys of v5 in reading order, each with its default; entries starting with "-" are section headings
GLUE = """
- control; Echo False; AbortLevel "FATAL"; TMax 0; DT 0.025; ModCoupling 1; InterpOrder 2; NumCrctn 0;
RhoInf 1.0; ConvTol 1e-6; MaxConvIter 20; DT_UJac 99999; UJacSclFact 1e6;
- features; NRotors 1; CompElast 1; CompInflow 0; CompAero 0; CompServo 0; CompSeaSt 1; CompHydro 1;
CompSub 0; CompMooring 1; CompIce 0; CompSoil 0; MHK 0; MirrorRotor F;
- environment; Gravity 9.81; AirDens 1.225; WtrDens 1025; KinVisc 1.464e-05; SpdSound 335; Patm 103500;
Pvap 1700; WtrDpth 200; MSL2SWL 0;
- files; EDFile "ED.dat"; BDBldFile(1) "unused"; BDBldFile(2) "unused"; BDBldFile(3) "unused";
InflowFile "IW.dat"; AeroFile "AD.dat"; ServoFile "SV.dat"; SeaStFile "SS.dat"; HydroFile "HD.dat";
SubFile "unused"; MooringFile "mooring.dat"; IceFile "unused"; SoilFile "unused";
- output; SumPrint False; SttsTime 100; ChkptTime 99999; DT_Out 0.1; TStart 0; OutFileFmt 1; TabDelim True;
OutFmt "ES16.8E2";
- linearisation; Linearize False; CalcSteady False; TrimCase 3; TrimTol 0.001; TrimGain 0.01; Twr_Kdmp 0;
Bld_Kdmp 0; NLinTimes 2; LinTimes 30, 60; LinInputs 1; LinOutputs 1; LinOutJac False; LinOutMod False;
- pictures; WrVTK 0; VTK_type 2; VTK_fields False; VTK_fps 15
"""
ELASTODYN = """
- control; Echo False; Method 3; DT "default";
- degrees of freedom; FlapDOF1 False; FlapDOF2 False; EdgeDOF False; PitchDOF False; TeetDOF False;
DrTrDOF False; GenDOF False; YawDOF False; TwFADOF1 False; TwFADOF2 False; TwSSDOF1 False; TwSSDOF2 False;
PtfmSgDOF True; PtfmSwDOF True; PtfmHvDOF True; PtfmRDOF True; PtfmPDOF True; PtfmYDOF True;
- start; OoPDefl 0; IPDefl 0; BlPitch(1) 0; BlPitch(2) 0; BlPitch(3) 0; TeetDefl 0; Azimuth 0; RotSpeed 0;
NacYaw 0; TTDspFA 0; TTDspSS 0; PtfmSurge 0; PtfmSway 0; PtfmHeave 0; PtfmRoll 0; PtfmPitch 0; PtfmYaw 0;
- turbine; NumBl; TipRad; HubRad; PreCone(1); PreCone(2); PreCone(3); HubCM; UndSling; Delta3; AzimB1Up;
OverHang; ShftGagL; ShftTilt; NacCMxn; NacCMyn; NacCMzn; NcIMUxn; NcIMUyn; NcIMUzn; Twr2Shft; TowerHt;
TowerBsHt; PtfmCMxt; PtfmCMyt; PtfmCMzt; PtfmRefxt 0; PtfmRefyt 0; PtfmRefzt;
- mass; TipMass(1); TipMass(2); TipMass(3); PBrIner(1) 0; PBrIner(2) 0; PBrIner(3) 0; BlPIner(1) 0;
BlPIner(2) 0; BlPIner(3) 0; HubMass; HubIner; HubIner_Teeter 0; GenIner; NacMass; NacYIner; YawBrMass;
PtfmMass; PtfmRIner; PtfmPIner; PtfmYIner; PtfmXYIner 0; PtfmYZIner 0; PtfmXZIner 0;
- blade; BldNodes; BldFile1 "blade_ed.dat"; BldFile2 "blade_ed.dat"; BldFile3 "blade_ed.dat";
- teeter; TeetMod; TeetDmpP; TeetDmp; TeetCDmp; TeetSStP; TeetHStP; TeetSSSp; TeetHSSp;
- yaw friction; YawFrctMod 0; M_CSmax 0; M_FCSmax 0; M_MCSmax 0; M_CD 0; M_FCD 0; M_MCD 0; sig_v 0;
sig_v2 0; OmgCut 0;
- drivetrain; GBoxEff; GBRatio; DTTorSpr; DTTorDmp;
- furling; Furling False; FurlFile "unused";
- tower; TwrNodes; TwrFile "tower.dat";
- output; SumPrint True; OutFile 1; TabDelim True; OutFmt "ES16.8E2"; TStart 0; DecFact 1; NTwGages 0;
TwrGagNd 0; NBlGages 2; BldGagNd 5, 9
"""
SEASTATE = """
Echo False;
- environment; WtrDens "default"; WtrDpth "default"; MSL2SWL "default";
- grid; X_HalfWidth 5; Y_HalfWidth 5; Z_Depth "default"; NX 2; NY 2; NZ 15;
- waves; WaveMod 0; WaveStMod 0; WvCrntMod 0; WaveTMax 720; WaveDT 0.2; WaveHs 0; WaveTp 10;
WavePkShp "default"; WvLowCOff 0.0; WvHiCOff 6.0; WaveDir 0; WaveDirMod 0; WaveDirSpread 1; WaveNDir 1;
WaveDirRange 90; WaveSeed(1) 1234567; WaveSeed(2) RANLUX; WaveNDAmp False; WvKinFile "waves.txt";
- second order; WvDiffQTF False; WvSumQTF False; WvLowCOffD 0; WvHiCOffD; WvLowCOffS 0.3; WvHiCOffS 3.2;
- constrained; ConstWaveMod 0; CrestHmax 1; CrestTime 60; CrestXi 0; CrestYi 0;
- current; CurrMod 0; CurrSSV0 0; CurrSSDir "default"; CurrNSRef 20; CurrNSV0 0; CurrNSDir 0; CurrDIV 0;
CurrDIDir 0;
- diffraction of members; MCFD 0;
- output; SeaStSum False; OutSwtch 2; OutFmt "ES16.8E2"; OutSFmt "A15"; NWaveElev 1; WaveElevxi 0;
WaveElevyi 0; NWaveKin 0; WaveKinxi 0; WaveKinyi 0; WaveKinzi 0;
- channels; "Wave1Elev"; END
"""
INFLOW = """
- steady wind (kind 1), uniform wind of a file (kind 2) or a box (kind 3); Echo False; WindType 1;
PropagationDir 0; VFlowAng 0; VelInterpCubic False; NWindVel 1; WindVxiList 0; WindVyiList 0; WindVziList 150;
- steady; HWindSpeed 0; RefHt 150; PLExp 0;
- uniform; Filename_Uni "wind.wnd"; RefHt_Uni 150; RefLength 241.94;
- a TurbSim box (kind 3); FileName_BTS "unused";
- boxes; FilenameRoot "unused"; TowerFile False;
- boxes; FileName_u "unused"; FileName_v "unused"; FileName_w "unused"; nx 64; ny 32; nz 32; dx 16; dy 3;
dz 3; RefHt_Hawc 150;
- boxes; ScaleMethod 1; SFx 1; SFy 1; SFz 1; SigmaFx 12; SigmaFy 8; SigmaFz 2;
- boxes; URef 8; WindProfile 0; PLExp_Hawc 0; Z0 0; XOffset 0;
- lidar; SensorType 0; NumPulseGate 0; PulseSpacing 30; NumBeam 0; FocalDistanceX 0; FocalDistanceY 0;
FocalDistanceZ 0; RotorApexOffsetPos 0 0 0; URefLid 17; MeasurementInterval 0.25; LidRadialVel False;
ConsiderHubMotion 1;
- output; SumPrint False; OutList; "Wind1VelX"; END
"""
TURBSIM = """
- run; Echo False; RandSeed1; RandSeed2 RANLUX; WrBHHTP False; WrFHHTP False; WrADHH False; WrADFF True;
WrBLFF False; WrADTWR False; WrHAWCFF False; WrFMTFF False; WrACT False; ScaleIEC 0;
-; - turbine; NumGrid_Z 3; NumGrid_Y 3; TimeStep 0.05; AnalysisTime 660; UsableTime ALL; HubHt 90;
GridHeight 20; GridWidth 20; VFlowAng 0; HFlowAng 0;
-; - weather; TurbModel IECKAI; UserFile unused; IECstandard 1-ED3; IECturbc B; IEC_WindType NTM;
ETMc default; WindProfileType PL; ProfileFile unused; RefHt 90; URef; ZJetMax default; PLExp 0.0; Z0 default;
-; - not of IEC; Latitude default; RICH_NO 0.05; UStar default; ZI default; PC_UW default; PC_UV default;
PC_VW default;
-; - coherence; SCMod1 default; SCMod2 default; SCMod3 default; InCDec1 default; InCDec2 default;
InCDec3 default; CohExp default;
-; - events; CTEventPath unused; CTEventFile Random; Randomize True; DistScl 1; CTLy 0.5; CTLz 0.5;
CTStartTime 30
"""
FLOATING = """
Echo False;
- platform; PotMod 1; ExctnMod 1; ExctnDisp 0; ExctnCutOff 10; PtfmYMod 0; PtfmRefY 0; PtfmYCutOff 0.01;
NExctnHdg 36; RdtnMod 1; RdtnTMax 60; RdtnDT "default"; NBody 1; NBodyMod 1; PotFile "HydroData/body";
WAMITULEN 1; PtfmRefxt 0; PtfmRefyt 0; PtfmRefzt 0; PtfmRefztRot 0; PtfmVol0; PtfmCOBxt 0; PtfmCOByt 0;
NAddDOF 0;
- second order; MnDrift 0; NewmanApp 0; DiffQTF 0; SumQTF 0;
- additional; AddF0 0; - 0; - 0; - 0; - 0; - 0
"""
SIMPLE = """
- strip theory; WaveDisp 0; AMMod 0; HstMod 0
"""
MATRICES = ("AddCLin", "AddBLin", "AddBQuad")
HYDRO_OUTPUT = """
- output; HDSum True; OutAll False; OutSwtch 2; OutFmt "ES16.8E2"; OutSFmt "A15";
- channels; "B1WvsF1xi"; "B1WvsF1zi"; "B1WvsM1yi"; "B1WvsF2xi"; "B1WvsF2zi"; "B1WvsM2yi"; "HydroFxi";
"HydroFzi"; "HydroMyi"; END
"""
ELASTO_CHANNELS = (
    *MOTIONS, "RotSpeed", "GenSpeed", "BldPitch1", "RotThrust", "RotTorq", "NcIMUTAxs", "TwrBsMyt",
    "TwrBsMxt", "TwrBsFxt", "Azimuth", "TTDspFA", "TTDspSS", "RootMxc1", "RootMyc1", "RootMyc2", "RootMyc3",
    "YawBrMyp", "YawBrMzp", "OoPDefl1", "IPDefl1", "LSSTipMya", "LSSTipMza",
)  # fmt: skip
AERO_CHANNELS = ("RtFldFxh", "RtFldMxh", "RtFldFyh", "RtFldFzh", "RtFldMyh", "RtFldMzh")
NODE_CHANNELS = (
    "Alpha", "VRel", "AxInd", "TnInd", "Cl", "Cd", "Cm", "Cn", "Ct", "Fx", "Fy", "VDisx", "VDisy",
)  # fmt: skip
LINE_TENSIONS = "".join(f"{end}Ten{k}\n" for end in ("Fair", "Anch") for k in (1, 2, 3)) + "END\n--- end\n"
BENDING = {  # degrees of freedom by number of modes: of a blade (first edge, one or two flap), tower each way
    "blades": {2: ("FlapDOF1", "EdgeDOF"), 3: ("FlapDOF1", "FlapDOF2", "EdgeDOF")},
    "tower": {1: ("TwFADOF1", "TwSSDOF1"), 2: ("TwFADOF1", "TwFADOF2", "TwSSDOF1", "TwSSDOF2")},
}


def pattern(key):
    """Return the regular expression of a value and its key in a deck; brackets of the key are optional."""
    bare = re.escape(key).replace(r"\(", r"\(?").replace(r"\)", r"\)?")
    return rf"^[ \t]*(\"[^\"\n]*\"|[^\s\"]+)([ \t]+{bare}(?=\s|$))"


def keys_of(settings):
    """Return settings with keys such as BlPitch__1 written as BlPitch(1)."""
    return {name.replace("__", "(") + (")" if "__" in name else ""): v for name, v in settings.items()}


def filled(layout, deck="", **settings):
    """Return the text of an input file: keys of the layout with their setting, default or value in the deck.

    Raises: KeyError for a setting that is not in the layout, and for a key without a value.
    """
    lines, settings = [], keys_of(settings)
    for line in (part.strip() for part in layout.replace("\n", " ").split(";")):
        key, _, value = line.partition(" ")
        if key == "-" or line.startswith('"') or line == "END":
            lines.append(value if value[:1].isdigit() else line)
            continue
        if not value and (match := re.search(pattern(key), deck, re.M)):
            value = match[1]
        value = settings.pop(key, value)
        if value == "" and key != "OutList":
            raise KeyError(key)
        lines.append(f"{value} {key}")
    if settings:
        raise KeyError(f"unknown keys: {sorted(settings)}")
    return "\n".join(lines) + "\n"


def put(text, **values):
    """Return deck text with the value of each key replaced at its first occurrence."""
    for key, value in keys_of(values).items():
        replaced = re.compile(pattern(key), re.M)
        text, count = replaced.subn(lambda match, value=value: f"{value}{match[2]}", text, count=1)
        if not count:
            raise KeyError(key)
    return text


def with_channels(text, channels):
    """Return deck text with the first list of channels replaced, and the rest cut off."""
    head = text[: text.index("\n", text.index("OutList")) + 1]
    return head + "".join(f'"{name}"\n' for name in channels) + "END\n"


def matrix(name, entries):
    """Return the text of a 6x6 matrix of HydroDyn; entries: {(i, j) from 1: value}."""
    rows = [" ".join(repr(float(entries.get((i, j), 0.0))) for j in range(1, 7)) for i in range(1, 7)]
    return "\n".join([f"{rows[0]} {name}", *rows[1:]]) + "\n"


def table(key, rows):
    """Return the text of a table of HydroDyn: number of rows, two header lines, rows."""
    return f"- table\n{len(rows)} {key}\n-\n-\n" + "".join(f"{row}\n" for row in rows)


def members_text(axial=("1 0 0 1 0 0 1",), joints=(), sections=(), coefficients=(), members=(), fills=()):
    """Return the text of the strip-theory section of HydroDyn v5, with all tables in order."""
    simple = [f"- simple{shape}\n-\n-\n{'0 ' * n}\n" for shape, n in (("", 14), (", rectangular", 18))]
    before = {"NAxCoef": axial, "NJoints": joints, "NPropSetsCyl": sections, "NPropSetsRec": ()}
    after = {
        "NCoefDpthCyl": (), "NCoefDpthRec": (), "NCoefMembersCyl": coefficients, "NCoefMembersRec": (),
        "NMembers": members, "NFillGroups": fills, "NMGDepths": (), "NMOutputs": (),
    }  # fmt: skip
    parts = [[table(*part) for part in tables.items()] for tables in (before, after)]
    return "".join([*parts[0], *simple, *parts[1], "- joints\n0 NJOutputs\n0 JOutLst\n"])


def write_elastodyn(folder, deck, case, channels=ELASTO_CHANNELS, **files):
    """Write ED.dat of a run, rigid except for the case's degrees of freedom; copy blade and tower files."""
    pitches = case.get("pitches", (case.get("pitch", 0),) * 3)
    fixed = {f"Ptfm{k}DOF": False for k in ("Sg", "Sw", "Hv", "R", "P", "Y")} if case.get("fixed") else {}
    free = {name: True for part, modes in BENDING.items() for name in modes.get(case.get(part), ())}
    torque = case.get("control") or case.get("torque_until") is not None
    text = filled(
        ELASTODYN, deck, GenDOF=bool(torque), DrTrDOF=bool(case.get("torsion")), **free,
        RotSpeed=case.get("rpm", 0), BldGagNd=case.get("gauges", "5, 9"), **fixed,
        **{f"BlPitch__{k}": pitches[k - 1] for k in BLADES},
        **{name: case[name] for name in (*MOTIONS, *STARTS) if name in case},
    )  # fmt: skip
    channels = "".join(f'"{name}"\n' for name in channels)
    (folder / "ED.dat").write_text(f"v5\n-\n{text}OutList\n{channels}END\n")
    for name, source in files.items():
        shutil.copy(source, folder / f"{name}.dat")


def write_sea(folder, case, components, **grid):
    """Write SS.dat and, if the case has wave components, their file."""
    settings = {"WvHiCOffD": 0.737863, **grid}
    if kind := case.get("sea"):
        settings |= {"WaveMod": "1P0.0", "WaveHs": kind[0], "WaveTp": kind[1]}
    elif case.get("waves"):
        rows = components.to_numpy()
        lines = [f"{omega:.10g} {2.0 * amplitude:.10g} 0 {phase:.8g}" for omega, amplitude, phase in rows]
        (folder / "waves.txt").write_text("components\n" + "\n".join(lines) + "\n")
        settings |= {"WaveMod": 7, "WaveHs": 1}
    (folder / "SS.dat").write_text("v5\n-\n" + filled(SEASTATE, **settings))


def write_glue(folder, case, **settings):
    """Write model.fst of a run."""
    aero = 2 if case.get("wind") is not None else 0
    servo = any(case.get(key) is not None for key in ("control", "pitch_to", "torque_until"))
    if case.get("fixed"):
        settings |= {"CompSeaSt": 0, "CompHydro": 0, "CompMooring": 0}
    settings |= {key: case[key] for key in ("Gravity", "NumCrctn") if key in case}
    text = filled(
        GLUE, TMax=case["t"], DT=case.get("dt", 0.025), DT_Out=case.get("dtout", 0.1),
        CompInflow=1 if aero else 0, CompAero=aero, CompServo=int(servo), **settings,
    )  # fmt: skip
    (folder / "model.fst").write_text(f"v5\n-\n{text}")


def end_nodes(text, last=None, inside=0.05):
    """Return an AeroDyn blade with extra nodes just inside root and tip.

    Of the nodes at the very root and tip AeroDyn sets the axial induction to 1 (FixedInductions): they see
    the rotation alone, and their load is that of an inflow angle of zero. last: m from the tip of one more
    node, which leaves hardly any length to the load of the tip.
    """
    lines = text.rstrip("\n").split("\n")
    first = next(k for k, line in enumerate(lines) if "NumBlNds" in line)
    count = int(lines[first].split()[0])
    rows = [[float(v) for v in line.split()] for line in lines[first + 3 : first + 3 + count]]

    def between(a, b, span):
        fraction = (span - a[0]) / (b[0] - a[0])
        row = [u + fraction * (v - u) for u, v in zip(a, b, strict=True)]
        row[6] = (a if fraction < 0.5 else b)[6]  # the polar
        return row

    root = between(rows[0], rows[1], rows[0][0] + inside)
    tip = between(rows[-2], rows[-1], rows[-1][0] - inside)
    further = [] if last is None else [between(tip, rows[-1], rows[-1][0] - last)]
    rows = [rows[0], root, *rows[1:-1], tip, *further, rows[-1]]
    body = [" ".join(f"{v:.12g}" if k != 6 else str(int(v)) for k, v in enumerate(row)) for row in rows]
    lines[first] = lines[first].replace(str(count), str(len(rows)), 1)
    return "\n".join(lines[: first + 3] + body) + "\n"


class Deck:
    """Represents a public deck: folder and name, tower and blade files, and files of the floating body."""

    ends = (".1", ".3", ".hst", ".12d")
    hub, diameter, interpolation = 150.0, 241.94, "DEFAULT"

    def read(self, part):
        """Return the text of a file of the deck."""
        return (self.own / f"{self.name}_{part}.dat").read_text(errors="replace")

    def _elastodyn(self):
        """Return the text of ElastoDyn's input."""
        return self.read("ElastoDyn")

    def begin(self, folder, case):
        """Create the folder of a run with the files of structure and floating body."""
        folder.mkdir(parents=True)
        tower = self.own / f"{self.name}_{self.tower}.dat"
        channels = case.get("channels", ELASTO_CHANNELS)
        write_elastodyn(folder, self._elastodyn(), case, channels, blade_ed=self.blade, tower=tower)
        (folder / "HydroData").mkdir()
        for end in self.ends:
            shutil.copy(self.own / "HydroData" / f"{self.body}{end}", folder / "HydroData" / f"body{end}")

    def _write_wind(self, folder, case, hub_wind):
        """Write AD.dat with blade and airfoils, IW.dat, and the uniform wind file if needed."""
        text, blade, polars = self._aerodyn()
        text = re.sub(r'"[^"]*Airfoils/', '"Airfoils/', text)
        text = re.sub(r'"[^"]*blade\.dat"', '"blade_ad.dat"', text)
        unsteady, nodes = case.get("unsteady", 0), case.get("nodes", ())
        text = put(
            text, TwrPotent=case.get("potential", 0), TwrShadow=case.get("shadow", 0),
            DBEMT_Mod=case.get("dbemt", 0), UA_Mod=unsteady, AoA34=case.get("at_3_4_chord", bool(unsteady)),
            NBlOuts=len(nodes),
        )  # fmt: skip
        if nodes:
            text = re.sub(r"^[\d, \t]+(\s+BlOutNd)", rf"{', '.join(map(str, nodes))}\1", text, flags=re.M)
        text = re.sub(r"^\S+\s+Buoyancy\s.*\n", "", text, flags=re.M)
        start, end = text.index("TwrElev"), text.index("======", text.index("TwrElev"))
        rows = text[start:end].strip("\n").split("\n")
        rows = rows[:2] + [f"{row} 0 0" for row in rows[2:]]
        channels = [f"B1N{k}{name}" for k in range(1, len(nodes) + 1) for name in NODE_CHANNELS]
        text = text[:start] + "\n".join(rows) + "\n" + text[end:]
        (folder / "AD.dat").write_text(with_channels(text, [*AERO_CHANNELS, *channels]))
        (folder / "blade_ad.dat").write_text(end_nodes(blade, case.get("last_node")))
        (folder / "Airfoils").mkdir()
        for polar in polars.iterdir():  # coordinates are for acoustics and plots only
            text = re.sub(r"^\S+(\s+NumCoords)", r"0\1", polar.read_text(), flags=re.M)
            text = put(text, InterpOrd=self.interpolation)
            (folder / "Airfoils" / polar.name).write_text(text)
        wind, kind, box = case.get("wind") or 0.0, 1, "unused"
        if isinstance(wind, Path):
            wind, kind, box = 0.0, 3, wind
        elif not isinstance(wind, (int, float)):
            rows, shear = hub_wind.to_numpy() if wind == "hub_wind" else wind, case.get("shear", 0)
            lines = [f"{time:.4f} {speed:.6f} 0 0 0 {shear} 0 0" for time, speed in rows]
            head = "! time speed direction vertical shear shear shear gust"
            (folder / "wind.wnd").write_text("\n".join([head, *lines]) + "\n")
            wind, kind = 0.0, 2
        text = filled(
            INFLOW, WindType=kind, HWindSpeed=wind, PLExp=case.get("shear", 0.0), RefHt=self.hub,
            RefHt_Uni=self.hub, RefLength=self.diameter, WindVziList=self.hub, RefHt_Hawc=self.hub,
            PropagationDir=case.get("direction", 0), FileName_BTS=f'"{box}"',
        )  # fmt: skip
        (folder / "IW.dat").write_text(f"v5\n-\n{text}")

    def _write_servodyn(self, folder, case, library):
        """Write SV.dat: the library; or a pitch manoeuvre of all blades ("pitch_to" degrees at 20 s); or a
        generator with constant torque ("torque" N m) up to a time ("torque_until" s).
        """
        control, target = 5 if case.get("control") else 0, case.get("pitch_to")
        stop = case.get("torque_until")
        text = put(self._servodyn(), PCMode=control, VSContrl=1 if stop is not None else control,
                   DLL_FileName=f'"{library}"', DLL_InFile='"DISCON.IN"',
                   DLL_DT=case.get("control_dt", "0.025") if control else '"default"')  # fmt: skip
        if case.get("individual"):
            text = put(text, Ptch_Cntrl=1)
        if target is not None:
            text = put(text, **{f"TPitManS__{k}": 20.0 for k in BLADES},
                       **{f"PitManRat__{k}": 2.0 for k in BLADES},
                       **{f"BlPitchF__{k}": target for k in BLADES})  # fmt: skip
        if stop is not None:  # rated speed 1 rpm: above it the torque is constant
            text = put(text, TimGenOf=stop, VS_RtGnSp=1.0, VS_RtTq=case["torque"], VS_Rgn2K=1e-6, VS_SlPc=5.0)
        neutral = {"PitNeut": case.get("pitch", 0), "PitSpr": 0, "PitDamp": 0}  # fixed without a controller
        springs = "".join(f"{value} {name}({k})\n" for name, value in neutral.items() for k in BLADES)
        text = re.sub(r"^(.*\sTPCOn\s.*\n)", lambda match: match[1] + springs, text, count=1, flags=re.M)
        (folder / "SV.dat").write_text(with_channels(text, ("GenTq", "GenPwr")))


class Volturnus(Deck):
    """Writes runs of the IEA 15 MW on VolturnUS-S: potential flow, drag matrix, MAP++, static polars."""

    name = body = "IEA-15-240-RWT-UMaineSemi"
    tower = "ElastoDyn_tower"

    def __init__(self, decks):
        root = Path(decks) / "iea15_volturnus_s"
        self.own, self.rotor = root / "OpenFAST" / self.name, root / "OpenFAST" / "IEA-15-240-RWT"
        self.blade = self.rotor / "IEA-15-240-RWT_ElastoDyn_blade.dat"
        tests = root / "rosco_v2.10_deck" / "Examples" / "Test_Cases" / "IEA-15-240-RWT"
        self.discon = tests / self.name / f"{self.name}_DISCON.IN"

    def inputs(self, case):
        """Return the paths of the deck files that a run uses."""
        paths = [self.own / f"{self.name}_{part}.dat" for part in ("ElastoDyn", self.tower)] + [self.blade]
        if not case.get("fixed"):
            body = [self.own / "HydroData" / f"{self.body}{end}" for end in self.ends]
            paths += [self.own / f"{self.name}_MAP.dat", *(body if case.get("qtf") else body[:3])]
        if case.get("wind") is not None:
            paths += [self.own / f"{self.name}_AeroDyn15.dat", self.rotor / "Airfoils",
                      self.rotor / "IEA-15-240-RWT_AeroDyn15_blade.dat"]  # fmt: skip
        if case.get("control"):
            paths += [self.discon, self.rotor / "Cp_Ct_Cq.IEA15MW.txt"]
        if case.get("control") or case.get("pitch_to") is not None:
            paths.append(self.own / f"{self.name}_ServoDyn.dat")
        return paths

    def write(self, folder, case, components=None, hub_wind=None, rosco="libdiscon.so", **_):
        """Write all inputs of a run; rosco: path of the ROSCO library."""
        self.begin(folder, case)
        drag = {
            (1, 1): 9.23e5, (2, 2): 9.23e5, (3, 3): 2.30e6, (4, 4): 1.68e10, (5, 5): 1.68e10,
            (6, 6): 4.80e10, (1, 5): -8.92e6, (5, 1): -8.92e6, (2, 4): 8.92e6, (4, 2): 8.92e6,
        }  # fmt: skip
        wet = bool(case.get("sea") or case.get("waves"))
        platform = filled(FLOATING, PtfmVol0=20206.34889, DiffQTF=case.get("qtf", 0), ExctnMod=int(wet))
        added = "".join(matrix(name, drag if name == "AddBQuad" else {}) for name in MATRICES)
        strips = filled(SIMPLE) + members_text()
        (folder / "HD.dat").write_text(f"v5\n-\n{platform}{added}{strips}" + filled(HYDRO_OUTPUT))
        write_sea(folder, case, components)
        if case.get("moordyn"):
            text = self.read("MoorDyn")
            text = text[: text.index("OUTPUTS")] + "OUTPUTS\n" + LINE_TENSIONS
        else:
            text = re.sub(r"(850\.00\s+1\s+2)", r"\1 tension_fair tension_anch", self.read("MAP"))
            # anchors at 837.6 m, as in the MoorDyn file of the deck
            text = text.replace("-837.800", "-837.600").replace("ˆ", "^")
        (folder / "mooring.dat").write_text(text)
        self._write_wind(folder, case, hub_wind)
        self._write_servodyn(folder, case, rosco)
        if case.get("control"):
            text = re.sub(r'^"[^"]*"(\s*! PerfFileName)', r'"Cp_Ct_Cq.txt"\1', self.discon.read_text(),
                          flags=re.M)  # fmt: skip
            if case.get("individual"):
                text = re.sub(r"^\S+(\s+! IPC_ControlMode)", r"1\1", text, flags=re.M)
            (folder / "DISCON.IN").write_text(text)
            shutil.copy(self.rotor / "Cp_Ct_Cq.IEA15MW.txt", folder / "Cp_Ct_Cq.txt")
        write_glue(folder, case, CompMooring=3 if case.get("moordyn") else 1)

    def _aerodyn(self):
        """Return texts of AeroDyn's input and blade, and the folder of polars."""
        blade = (self.rotor / "IEA-15-240-RWT_AeroDyn15_blade.dat").read_text()
        return self.read("AeroDyn15"), blade, self.rotor / "Airfoils"

    def _servodyn(self):
        """Return the text of ServoDyn's input."""
        return self.read("ServoDyn")


def section(text, key):
    """Return the rows (lists of words) of a table in the old HydroDyn format."""
    lines = text.split("\n")
    at = next(k for k, line in enumerate(lines) if re.match(rf"\s*\d+\s+{key}(\s|$)", line))
    count = int(lines[at].split()[0])
    rows = lines[at + 1 :]
    while not rows[0].lstrip().startswith("("):
        rows = rows[1:]
    return [row.split("!")[0].split() for row in rows[1 : count + 1]]


def moordyn_text(text):
    """Return a MoorDyn file of FAST 8 in v2 format."""

    def rows(name, count):
        lines = text[text.index(name) :].split("\n")
        return [line.split() for line in lines[4 : 4 + count]]

    kind = rows("LINE TYPES", 1)[0]
    points = [[*row[:7], row[10], row[11]] for row in rows("CONNECTION PROPERTIES", 6)]
    lines = [[row[0], row[1], row[4], row[5], row[2], row[3], "-"] for row in rows("LINE PROPERTIES", 3)]
    can, cat, cdn, cdt = kind[5:9]
    parts = {
        "LINE TYPES": [[*kind[:5], "0", cdn, can, cdt, cat]],
        "POINTS": points,
        "LINES": lines,
        "OPTIONS": [["0.002", "dtM"], ["3.0e6", "kbot"], ["3.0e5", "cbot"], ["2.0", "dtIC"],
                    ["60.0", "TmaxIC"], ["4.0", "CdScaleIC"], ["0.001", "threshIC"]],
    }  # fmt: skip
    out = "--- MoorDyn\nv2\n"
    for name, table_rows in parts.items():
        out += f"---- {name} ----\n" + ("" if name == "OPTIONS" else "-\n-\n")
        out += "".join(" ".join(row) + "\n" for row in table_rows)
    return out + f"---- OUTPUTS ----\n{LINE_TENSIONS}"


class Oc4(Deck):
    """NREL 5 MW on the OC4 semi-submersible: potential flow, drag of 25 members, water in six of them."""

    name, body, tower = "NRELOffshrBsline5MW_OC4DeepCwindSemi", "marin_semi", "ElastoDyn_Tower"
    ends = (".1", ".hst", ".12d")
    gravity, density = 9.80665, 1025.0
    division = {"1": "2.5", "2": "2.0", "3": "3.0", "4": "6.0"}  # m, of the strips by the set of sections

    def __init__(self, decks):
        self.own = Path(decks) / "nrel5mw_oc4_semi" / "CertTest" / "5MW_Baseline"
        turbine = Path(decks) / "nrel5mw_turbine" / "Examples" / "Test_Cases" / "NREL-5MW"
        self.blade = turbine / "NRELOffshrBsline5MW_Blade.dat"
        data = Path(__file__).resolve().parents[3] / "fowt_env" / "data" / "platforms"
        self.excitation = data / "nrel5mw_oc4_semi.npz"

    def inputs(self, case):
        """Return the paths of the inputs of a run; the deck lacks a .3 file: excitation of the package."""
        parts = ["ElastoDyn", self.tower, "HydroDyn", "MoorDyn" if case.get("moordyn") else "MAP"]
        paths = [self.own / f"{self.name}_{part}.dat" for part in parts]
        second = {"qtf": ".12d", "sum_qtf": ".12s"}
        ends = [*self.ends[:2], *(end for key, end in second.items() if case.get(key))]
        paths += [self.own / "HydroData" / f"{self.body}{end}" for end in ends]
        return [*paths, self.blade, self.excitation]

    def write(self, folder, case, components=None, **_):
        """Write all inputs of a run."""
        self.begin(folder, case)
        (folder / "HydroData" / "body.3").write_text(self._excitation_text())
        if case.get("sum_qtf"):
            shutil.copy(self.own / "HydroData" / f"{self.body}.12s", folder / "HydroData" / "body.12s")
        (folder / "HD.dat").write_text(self._hydrodyn(case))
        # 2 m along the waves (shortest component: 9 m); all members are within 29 m and 20 m
        grid = {"X_HalfWidth": 60, "NX": 31, "Y_HalfWidth": 40, "NY": 2, "Z_Depth": 24, "NZ": 15}
        write_sea(folder, case, components, WaveDT=0.1, **grid)
        moordyn = case.get("moordyn")
        text = moordyn_text(self.read("MoorDyn")) if moordyn else self.read("MAP").replace("ˆ", "^")
        (folder / "mooring.dat").write_text(text)
        write_glue(folder, case, Gravity=self.gravity, CompMooring=3 if case.get("moordyn") else 1)

    def _excitation_text(self):
        """Return a WAMIT .3 file near heading 0 from package arrays, interpolated at the periods of the .1.

        Columns: period, heading, mode, magnitude, phase, real and imaginary part.
        """
        with np.load(self.excitation) as arrays:
            known, heading, force = (arrays[k] for k in ("excitation_omega", "heading", "excitation"))
        near = np.abs(np.degrees(heading)) < 21.0
        radiation = (self.own / "HydroData" / "marin_semi.1").read_text()
        texts = [line.split()[0] for line in radiation.split("\n") if line.strip()]
        rows, unit = [], self.density * self.gravity
        for text in dict.fromkeys(texts):
            if float(text) <= 0.0:
                continue
            omega = 2.0 * pi / float(text)
            for b, column in zip(np.degrees(heading[near]), force[:, near].swapaxes(0, 1), strict=True):
                for mode, x in enumerate(column.T / unit, 1):
                    x = np.interp(omega, known, x.real) + 1j * np.interp(omega, known, x.imag)
                    size, phase = abs(x), np.degrees(np.angle(x))
                    rows.append(f"{text} {b:.6f} {mode} {size:.8e} {phase:.6f} {x.real:.8e} {x.imag:.8e}")
        return "\n".join(rows) + "\n"

    def ballast(self, text):
        """Return [(mass, height of centre)] of the water in members: kg, m."""
        joints = {row[0]: float(row[3]) for row in section(text, "NJoints")}
        sizes = {row[0]: float(row[1]) - 2.0 * float(row[2]) for row in section(text, "NPropSets")}
        members = {row[0]: row for row in section(text, "NMembers")}
        result = []
        for number, *rest in section(text, "NFillGroups"):
            names, level = rest[: int(number)], float(rest[int(number)])
            for name in names:
                row = members[name]
                bottom, top = sorted(joints[joint] for joint in row[1:3])
                height = min(level, top) - bottom
                result.append((self.density * 0.25 * pi * sizes[row[3]] ** 2 * height, bottom + 0.5 * height))
        return result

    def _hydrodyn(self, case):
        """Return the text of HD.dat: members of the deck with drag and internal water."""
        text = self.read("HydroDyn")
        wet = bool(case.get("sea") or case.get("waves"))
        quadratic = {"DiffQTF": case.get("qtf", 0), "SumQTF": case.get("sum_qtf", 0)}
        platform = filled(FLOATING, text, **quadratic, ExctnMod=int(wet))
        # the old HydroDyn kept the weight of the water fixed, which the deck corrects by a stiffness
        restored = -sum(self.gravity * mass * height for mass, height in self.ballast(text))
        stiffness = float(re.search(r"^\s+0\s+0\s+0\s+([1-9]\d+)\s+0\s+0\s*$", text, re.M)[1]) - restored
        entries = {"AddCLin": {(4, 4): stiffness, (5, 5): stiffness}}
        added = "".join(matrix(name, entries.get(name, {})) for name in MATRICES)
        axial = [f"{name} {float(cd):g} {ca} {cp} 0 0 1" for name, cd, ca, cp in section(text, "NAxCoef")]
        # members above the water are omitted and strips are as long as the waves allow: run time grows with
        # the square of the number of nodes; one node is at the still water level
        joints = [row[:6] for row in section(text, "NJoints")]
        dry = {row[0] for row in joints if float(row[3]) >= 0.0}
        members = [row for row in section(text, "NMembers") if not dry.issuperset(row[1:3])]
        met = {joint for row in members for joint in row[1:3]}
        wetted = {row[0] for row in members}
        coefficients = [
            " ".join([name, *(f"{float(v):g}" for v in row[:4]), *row[4:12], *"0000", *row[12:20], *"1111"])
            for name, *row in section(text, "NCoefMembers") if name in wetted
        ]  # fmt: skip
        # cylinder, no rotation, division, member table, no separate hydrostatics
        rows = [" ".join([*r[:5], "1 0", self.division[r[3]], r[6], "1", r[7]]) for r in members]
        strips = members_text(
            axial, [" ".join(row) for row in joints if row[0] in met],
            [" ".join(row[:3]) for row in section(text, "NPropSets")], coefficients, rows,
            [" ".join(row) for row in section(text, "NFillGroups")],
        )  # fmt: skip
        return f"v5\n-\n{platform}{added}" + filled(SIMPLE) + strips + filled(HYDRO_OUTPUT)


class Oc3(Deck):
    """Writes runs of the NREL 5 MW on the OC3-Hywind spar: strip theory, MAP++; zero tilt and cone."""

    name, body, tower = "NRELOffshrBsline5MW_OC3Hywind", "spar", "ElastoDyn_Tower"
    ends = ()
    hub, diameter, interpolation = 90.0, 126.0, 1
    # of a member: Cd, Ca, Cp, axial Cd, Ca, Cp, Cb, four numbers each
    coefficients = "0.6 0.6 0 0 0.969954 0.969954 0 0 1 1 1 1 0 0 0 0 0 0 0 0 1 1 1 1 1 1 1 1"

    def __init__(self, decks):
        self.own = Path(decks) / "nrel5mw_oc3_hywind" / "CertTest" / "5MW_Baseline"
        self.turbine = Path(decks) / "nrel5mw_turbine" / "Examples" / "Test_Cases" / "NREL-5MW"
        self.blade = self.turbine / "NRELOffshrBsline5MW_Blade.dat"

    def inputs(self, case):
        """Return the paths of the deck files that a run uses."""
        parts = ["ElastoDyn", self.tower] + ([] if case.get("fixed") else ["HydroDyn", "MAP"])
        paths = [self.own / f"{self.name}_{part}.dat" for part in parts] + [self.blade]
        if case.get("wind") is not None:
            paths += [self.turbine / "NRELOffshrBsline5MW_Onshore_AeroDyn15.dat", self.turbine / "Airfoils",
                      self.turbine / "NRELOffshrBsline5MW_AeroDyn_blade.dat",
                      self.own / f"{self.name}_AeroDyn15.dat"]  # fmt: skip
        if case.get("control"):
            paths.append(self.own / "ServoData" / "DISCON_OC3Hywind.f90")
        if case.get("control") or case.get("torque_until") is not None:
            paths.append(self.turbine / "NRELOffshrBsline5MW_Onshore_ServoDyn.dat")
        return paths

    def write(self, folder, case, components=None, hub_wind=None, baseline="DISCON_OC3Hywind.so", **_):
        """Write all inputs of a run; baseline: path of the compiled DISCON_OC3Hywind.f90."""
        self.begin(folder, case)
        (folder / "HD.dat").write_text(self._hydrodyn())
        zeros = [f"{i} {j} 0" for i in range(1, 7) for j in range(1, 7)]
        (folder / "HydroData" / "body.hst").write_text("\n".join(zeros) + "\n")
        ends = {"-1": "", "0": "", "5": " 0", "10": " 0"}  # damping at finite periods only
        rows = [f"{period} {row}{end}" for period, end in ends.items() for row in zeros]
        (folder / "HydroData" / "body.1").write_text("\n".join(rows) + "\n")
        rows = [f"{t} {b} {k} 0 0 0 0" for t in (5, 10) for b in (-180, 0, 180) for k in range(1, 7)]
        (folder / "HydroData" / "body.3").write_text("\n".join(rows) + "\n")
        write_sea(folder, case, components, WaveDT=0.1, Z_Depth=130, NZ=60)
        if case.get("moordyn"):
            text = moordyn_text(self.read("MoorDyn"))
        else:
            text = self.read("MAP").replace("ˆ", "^")
        (folder / "mooring.dat").write_text(text)
        self._write_wind(folder, case, hub_wind)
        self._write_servodyn(folder, {"control_dt": '"default"', **case}, baseline)
        if case.get("control"):
            (folder / "DISCON.IN").write_text("unused\n")
        mooring = 3 if case.get("moordyn") else 1
        write_glue(folder, case, Gravity=case.get("Gravity", 9.80665), WtrDpth=320, CompMooring=mooring)

    def _elastodyn(self):
        """Return the text of ElastoDyn's input without tilt and cone, the hub at the same height."""
        level = {f"PreCone__{k}": 0 for k in BLADES}
        return put(self.read("ElastoDyn"), ShftTilt=0, Twr2Shft=2.4, **level)

    def _servodyn(self):
        """Return the text of ServoDyn's input."""
        return (self.turbine / "NRELOffshrBsline5MW_Onshore_ServoDyn.dat").read_text()

    def _aerodyn(self):
        """Return texts of AeroDyn's input (tower of the spar) and straight blade, and the polars' folder."""
        text = (self.turbine / "NRELOffshrBsline5MW_Onshore_AeroDyn15.dat").read_text()
        text = put(text, AIDrag=True, TIDrag=True, NumTwrNds=11)
        spar = self.read("AeroDyn15")
        spar = spar[spar.index("TwrElev") :]
        rows = spar[: spar.index("======")].strip("\n").split("\n")
        rows = rows[:2] + [f"{row} 0.1 0" for row in rows[2:]]
        start, end = text.index("TwrElev"), text.index("======", text.index("TwrElev"))
        text = text[:start] + "\n".join(rows) + "\n" + text[end:]
        lines = (self.turbine / "NRELOffshrBsline5MW_AeroDyn_blade.dat").read_text().split("\n")
        first = next(k for k, line in enumerate(lines) if "NumBlNds" in line)
        nodes = [line.split() for line in lines[first + 3 : first + 3 + int(lines[first].split()[0])]]
        nodes[-1][0] = "61.5"  # 61.4999 in the deck, for the sake of BeamDyn
        nodes = [" ".join([row[0], "0 0 0", *row[4:]]) for row in nodes]
        return text, "\n".join([*lines[: first + 3], *nodes]) + "\n", self.turbine / "Airfoils"

    def _hydrodyn(self):
        """Return the text of HD.dat: three members; PotMod 1, without which the added matrices are unused."""
        text = self.read("HydroDyn")
        platform = filled(FLOATING, PtfmVol0=0, ExctnMod=0, RdtnMod=0)
        damping = {(k, k): value for k, value in ((1, 1e5), (2, 1e5), (3, 1.3e5), (6, 1.3e7))}
        entries = {"AddCLin": {(6, 6): 9.834e7}, "AddBLin": damping}
        added = "".join(matrix(name, entries.get(name, {})) for name in MATRICES)
        members = [row[:5] for row in section(text, "NMembers")]
        strips = members_text(
            ("1 0 0 1 0 0 1",), [" ".join(row[:6]) for row in section(text, "NJoints")],
            [" ".join(row[:3]) for row in section(text, "NPropSets")],
            [f"{row[0]} {self.coefficients}" for row in members],
            [f"{' '.join(row)} 1 0 2.0 3 1 F" for row in members],
        )  # fmt: skip
        return f"v5\n-\n{platform}{added}" + filled(SIMPLE) + strips + filled(HYDRO_OUTPUT)
