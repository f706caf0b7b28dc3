"""A command on a rig with a bus does not load the library of MDF files, which python-can would bring along."""

import subprocess
import sys

import pytest


@pytest.mark.exhaustive
def test_a_rig_with_a_bus_is_loaded_without_the_library_of_mdf_files():
    program = (
        "import sys; from recoil_rigs.rig import load_rig; load_rig('mixed');"
        "print(*{'can', 'cantools', 'asammdf', 'pandas', 'sympy'} & set(sys.modules));"
        "import asammdf, can; print(asammdf.MDF.__name__)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded, after = done.stdout.splitlines()
    assert set(loaded.split()) == {"can", "cantools"}
    assert after == "MDF"
