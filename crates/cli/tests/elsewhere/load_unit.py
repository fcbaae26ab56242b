"""Loads a co-simulation unit and steps it: a row of inputs a line from standard input, a row of outputs a line back, that at rest first."""
import ctypes as c
import glob
import sys
import xml.etree.ElementTree as xml
import zipfile

zipfile.ZipFile(sys.argv[1]).extractall("unit")
description = xml.parse("unit/modelDescription.xml").getroot()
co_simulation = description.find("CoSimulation")
period_s = float(co_simulation.get("fixedInternalStepSize"))
library = c.CDLL(glob.glob("unit/binaries/*/%s.*" % co_simulation.get("modelIdentifier"))[0])
library.fmi3InstantiateCoSimulation.restype = c.c_void_p
library.fmi3GetVersion.restype = c.c_char_p
assert library.fmi3GetVersion() == b"3.0"


def instance(token):
    no = c.c_bool(False)
    return library.fmi3InstantiateCoSimulation(
        b"unit", token.encode(), None, no, no, no, no, None, c.c_size_t(0), None, None, None
    )


assert instance("another") is None
unit = c.c_void_p(instance(description.get("instantiationToken")))
assert unit.value


def references(causality):
    found = [v for v in description.find("ModelVariables") if v.get("causality") == causality]
    return (c.c_uint32 * len(found))(*(int(v.get("valueReference")) for v in found))


inputs, outputs = references("input"), references("output")
values = (c.c_double * len(outputs))()


def do(function, *arguments):
    return getattr(library, function)(unit, *arguments)


def say():
    assert do("fmi3GetFloat64", outputs, c.c_size_t(len(outputs)), values, c.c_size_t(len(values))) == 0
    print(*values)


def step(time_s, step_s):
    flags, reached = [c.c_bool() for _ in range(3)], c.c_double()
    status = do("fmi3DoStep", c.c_double(time_s), c.c_double(step_s), c.c_bool(True), *map(c.byref, flags), c.byref(reached))
    assert status != 0 or abs(reached.value - time_s - step_s) < 1e-9
    return status


zero, no = c.c_double(0.0), c.c_bool(False)
assert do("fmi3EnterInitializationMode", no, zero, zero, no, zero) == 0
assert do("fmi3ExitInitializationMode") == 0
# What a unit does not do is an error and nothing else.
assert step(0.0, 0.3 * period_s) == 3 and step(0.0, float("nan")) == 3
assert do("fmi3SetFloat64", outputs, c.c_size_t(1), values, c.c_size_t(1)) == 3
assert do("fmi3GetFMUState") == 3
say()
for k, line in enumerate(sys.stdin):
    row = [float(word) for word in line.split()]
    given = (c.c_double * len(row))(*row)
    assert do("fmi3SetFloat64", inputs, c.c_size_t(len(inputs)), given, c.c_size_t(len(row))) == 0
    assert step(k * period_s, period_s) == 0
    say()
assert do("fmi3Terminate") == 0
library.fmi3FreeInstance(unit)
