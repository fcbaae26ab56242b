"""Has FMPy validate the units that are named, and simulate the first over the volts of standard input, a sample of 20 us a line."""
import sys

import numpy
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

for unit in sys.argv[1:]:
    problems = validate_fmu(unit)
    assert not problems, (unit, problems)
volts = numpy.array([float(line) for line in sys.stdin])
time_s = 2e-5 * numpy.arange(len(volts))
given = numpy.array(list(zip(time_s, volts)), dtype=[("time", float), ("voltage_v", float)])
found = simulate_fmu(
    sys.argv[1],
    start_time=0.0,
    stop_time=time_s[-1],
    step_size=2e-5,
    output_interval=2e-5,
    input=given,
    output=["position_um"],
    fmi_type="CoSimulation",
)
for position_um in found["position_um"]:
    print(repr(float(position_um)))
