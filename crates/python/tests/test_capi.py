"""The C interface by ctypes: a host in Python without the package gets the bits of the package's law."""

import ctypes
import os

import numpy as np
import pytest

import hysteron


class Input(ctypes.Structure):
    """`HysteronInput` of hysteron.h."""

    _fields_ = [
        (name, ctypes.c_float) for name in ("reference_um", "measured_um", "voltage2_v", "motion2_um", "temperature_c")
    ]


@pytest.fixture(scope="module")
def library():
    path = os.environ.get("HYSTERON_CAPI")
    if path is None:
        pytest.skip("HYSTERON_CAPI names no library; `cargo xtask python` does")
    library = ctypes.CDLL(path)
    law = ctypes.c_void_p
    for name, answer, arguments in [
        ("load", law, [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_size_t]),
        ("free", None, [law]),
        ("reset", None, [law, ctypes.c_float]),
        ("step", ctypes.c_float, [law, ctypes.POINTER(Input)]),
        ("due_um", ctypes.c_float, [law]),
        ("limited", ctypes.c_bool, [law]),
        ("samples_ahead", ctypes.c_size_t, [law]),
        ("sample_rate_hz", ctypes.c_double, [law]),
    ]:
        function = getattr(library, f"hysteron_{name}")
        function.restype, function.argtypes = answer, arguments
    return library


def test_val_ctypes_gets_the_bits_of_the_law(library, loop_model, tmp_path):
    # Feedback is compared in C, by a table that has it: its design takes half a minute.
    controller = hysteron.design(loop_model, volts=(0.0, 26.0), open=True)
    controller.save(tmp_path / "controller.toml")
    law = library.hysteron_load(bytes(tmp_path / "controller.toml"), None, 0)
    assert law
    assert library.hysteron_samples_ahead(law) == controller.samples_ahead
    assert library.hysteron_sample_rate_hz(law) == controller.fs
    t = np.arange(20_000) / controller.fs
    # Beyond the stroke as well, and a sensor that fails now and then.
    reference = (0.8 - 0.9 * np.cos(2 * np.pi * 50 * t)).astype(np.float32)
    reading = (reference + 0.01 * np.sin(2 * np.pi * 700 * t)).astype(np.float32)
    reading[::1009] = np.nan
    expected = controller.law("f32").step(reference, reading).astype(np.float32)
    for _ in range(2):
        library.hysteron_reset(law, 0.0)
        pairs = zip(reference, reading)
        found = np.array([library.hysteron_step(law, Input(r, y)) for r, y in pairs], dtype=np.float32)
        assert np.array_equal(found.view(np.uint32), expected.view(np.uint32))
    library.hysteron_free(law)


def test_refuse_what_is_no_controller(library, tmp_path):
    message = ctypes.create_string_buffer(1000)
    assert library.hysteron_load(bytes(tmp_path / "absent.toml"), message, len(message)) is None
    with pytest.raises(hysteron.Error) as refused:
        hysteron.Controller.load(tmp_path / "absent.toml")
    assert message.value.decode() == str(refused.value)
