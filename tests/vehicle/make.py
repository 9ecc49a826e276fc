"""Makes the vehicle's FMU for this machine with a C compiler and fmpy's FMI headers: python make.py FMU."""

import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"


def variable(name: str, reference: int, causality: str, start: float | None, unit: str) -> str:
    """A line of the model description."""
    kind = "tunable" if causality == "parameter" else "continuous"
    initial = ' initial="calculated"' if causality == "output" else ""
    value = "" if start is None else f' start="{start}"'
    return (
        f'    <ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{kind}"{initial}><Real{value} unit="{unit}"/></ScalarVariable>'
    )


def model_description() -> str:
    """Variables in the order of vehicle.c; x and v, the outputs, are those of 3 to 6."""
    variables = [variable(f"u[{k}]", k - 1, "input", 0.0, "1/s2") for k in (1, 2)]
    variables += [variable(f"x[{k}]", k + 1, "output", None, "1") for k in (1, 2)]
    variables += [variable(f"v[{k}]", k + 3, "output", None, "1/s") for k in (1, 2)]
    variables += [
        variable(name, 8 + place, "parameter", start, unit)
        for place, (name, start, unit) in enumerate(
            [
                ("mass", 2.0, "kg"),
                ("drag", 0.8, "kg"),
                ("lag", 0.02, "s"),
                ("x0[1]", 0.0, "1"),
                ("x0[2]", -8.0, "1"),
            ]
        )
    ]
    units = "".join(f'<Unit name="{name}"/>' for name in ("1", "1/s", "1/s2", "kg", "s"))
    outputs, initial = (
        "".join(f'<Unknown index="{index}"{known}/>' for index in range(3, 7))
        for known in (' dependencies=""', "")
    )
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<fmiModelDescription fmiVersion="2.0" modelName="vehicle" guid="{vehicle}">',
            '  <CoSimulation modelIdentifier="vehicle" canHandleVariableCommunicationStepSize="true"/>',
            f"  <UnitDefinitions>{units}</UnitDefinitions>",
            "  <ModelVariables>",
            *variables,
            "  </ModelVariables>",
            f"  <ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{initial}</InitialUnknowns>"
            "</ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def make_vehicle(output: Path) -> Path:
    """Compile and pack; returns the FMU."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "vehicle.so"
        options = ["-shared", "-fPIC", "-O2", "-std=gnu11", f"-I{HEADERS}"]
        subprocess.run(
            [shutil.which("cc") or "cc", *options, "-o", library, HERE / "vehicle.c", "-lm"], check=True
        )
        with zipfile.ZipFile(output, "w") as archive:
            archive.writestr("modelDescription.xml", model_description())
            archive.write(library, "binaries/linux64/vehicle.so")
    return output


if __name__ == "__main__":
    make_vehicle(Path(sys.argv[1]))
