import inspect
import math
import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

import recoil_processing
from recoil_processing import quality
from recoil_processing.quality.limits import LIMITS, Limit


@pytest.mark.parametrize("name", LIMITS)
def test_every_limit_says_what_it_limits_and_where_it_comes_from(name):
    limit = LIMITS[name]
    assert limit.what
    assert limit.source
    assert not any("\n" in text or text.endswith(".") for text in (limit.what, limit.source))
    assert limit.fail <= limit.warn if limit.below else limit.warn <= limit.fail


def test_every_limit_is_used_and_every_limit_that_is_used_exists():
    modules = Path(str(recoil_processing.__file__)).parent
    texts = (p.read_text(encoding="utf-8") for p in modules.rglob("*.py"))
    # a module of the verdict has a table of its own by this name
    text = "".join(text for text in texts if "quality.limits import" in text)
    used = set(re.findall(r'LIMITS\["(\w+)"\]', text))
    assert used == set(LIMITS)


def test_limits_cannot_be_changed():
    with pytest.raises(TypeError):
        LIMITS["clipped_share"] = Limit(0.0, 1.0, "", "")


@pytest.mark.parametrize(
    ("figure", "verdict"),
    [(0.0, "ok"), (1.0, "ok"), (1.5, "warn"), (2.5, "fail"), (math.inf, "fail"), (math.nan, "warn")],
)
def test_a_figure_is_judged_beyond_its_limits(figure, verdict):
    assert Limit(1.0, 2.0, "", "").verdict(figure) == verdict
    assert Limit(-1.0, -2.0, "", "", below=True).verdict(-figure) == verdict


def test_every_check_says_what_it_does_and_returns_a_verdict():
    modules = [import_module(f"{quality.__name__}.{one.name}") for one in iter_modules(quality.__path__)]
    checks = {name: one for module in modules for name, one in vars(module).items() if name.startswith("check_")}
    assert len(checks) > 30
    for name, function in checks.items():
        assert inspect.signature(function).return_annotation == "Outcome", name
        assert (function.__doc__ or "").split(".")[0], name
