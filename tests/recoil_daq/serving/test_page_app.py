"""The pages' application: it answers with the pages of one folder, and refuses all else, whatever it is asked."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from recoil_daq.serving.access import Access
from tests.builders.page_requests import HOST, asked

LAN = "192.168.1.20:8750"
TOKEN = "correct-horse-battery"  # noqa: S105 - of a test
BEYOND = Access("0.0.0.0", 8750, TOKEN)  # noqa: S104 - bound by nobody


@pytest.fixture
def day(tmp_path: Path) -> Path:
    """Return a folder of a day with what is served, what is not, and links of every kind."""
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "secret.html").write_text("secret", encoding="utf-8")
    out = tmp_path / "shots"
    for folder in ("reports/0001", "journal", "captures", "pages", ".git"):
        (out / folder).mkdir(parents=True)
    for name in (
        "live.html", "live.js", "live.json", "reports/0001/report.html", "pages/page.css", ".hidden.html",
        ".git/config.json", "0001.h5", "captures/0001.rdlog", "shotlog.csv.bak", "rig.toml", "key.pem",
        "reports/0001/ümlaut #1 %41.html",
    ):  # fmt: skip
        (out / name).write_text(f"this is {name}", encoding="utf-8")
    if os.name != "nt":
        (out / "link.html").symlink_to(outside / "secret.html")
        (out / "linked").symlink_to(outside)
        (out / "inner.html").symlink_to(out / "live.html")
        os.mkfifo(out / "pipe.html")
    (out / "folder.html").mkdir()
    return out


@pytest.mark.parametrize(
    ("target", "kind"),
    [
        ("/live.html", "text/html; charset=utf-8"),
        ("/live.js?k3j", "text/javascript; charset=utf-8"),
        ("/pages/page.css", "text/css; charset=utf-8"),
        ("/reports/0001/report.html", "text/html; charset=utf-8"),
        ("/reports/0001/%C3%BCmlaut%20%231%20%2541.html", "text/html; charset=utf-8"),
    ],
)
def test_pages_and_what_they_refer_to_are_read(day: Path, target: str, kind: str) -> None:
    answer = asked(day, target)
    assert (answer.status, answer.headers["content-type"]) == (200, kind)
    assert answer.body.startswith(b"this is ")
    assert int(answer.headers["content-length"]) == len(answer.body)


HOSTILE = [
    "/../outside/secret.html", "/%2e%2e/outside/secret.html", "/%2E%2E%2Foutside/secret.html",
    "/..%2foutside%2fsecret.html",
    "/..%5coutside%5csecret.html", "/..\\outside\\secret.html", "/%252e%252e/outside/secret.html",
    "/reports/../../outside/secret.html", "/reports/..%2f..%2foutside/secret.html", "/./live.html", "//live.html",
    "//127.0.0.1/live.html", "/%2fetc/passwd.html", "/%00live.html", "/live.html%00.png", "/live.html%0a",
    "/live.html/",
    "/live.html.", "/live.html%20", "/C:/secret.html", "/C:%5csecret.html", "/live.html::$DATA", "/live.html:x.html",
    "/%c0%ae%c0%ae/outside/secret.html", "/%ff.html", "/%e0%80%af.html", "/\\\\server\\share\\x.html", "/~root/x.html",
    "/.hidden.html", "/.git/config.json", "/%2egit/config.json", "/0001.h5", "/captures/0001.rdlog", "/shotlog.csv.bak",
    "/rig.toml", "/key.pem", "/etc/passwd", "/proc/self/environ", "/link.html", "/linked/secret.html", "/inner.html",
    "/pipe.html", "/folder.html", "/reports", "/reports/", "/a/b/c/d/e/f/g/h/i.html", "/" + "a" * 256 + ".html",
    "/*.html", "/live%3f.html", "/none.html", "live.html", "http://evil.example/live.html", "*",
]  # fmt: skip


@pytest.mark.parametrize("target", HOSTILE)
def test_what_is_no_page_of_the_folder_is_not_there(day: Path, target: str) -> None:
    answer = asked(day, target)
    assert answer.status == 404
    assert b"secret" not in answer.body
    assert b"this is" not in answer.body


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "get"])
def test_nothing_but_reading_is_answered(day: Path, method: str) -> None:
    answer = asked(day, "/live.html", method=method)
    assert (answer.status, answer.headers["allow"]) == (405, "GET, HEAD")
    assert b"this is" not in answer.body


@pytest.mark.parametrize(
    "headers",
    [
        (),
        (("host", "evil.example"),),
        (("host", "evil.example:8750"),),
        (("host", HOST), ("host", "evil.example")),
        (("host", "127.0.0.1.evil.example"),),
        (("host", "localhost@evil.example"),),
        (("host", "192.168.1.20:8750"),),
        (("host", "127.0.0.1:8750/x"),),
        (("host", ""),),
        (("host", HOST), ("origin", "http://evil.example")),
        (("host", HOST), ("origin", "null")),
        (("host", HOST), ("origin", "http://127.0.0.1:9999")),
        (("host", HOST), ("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "no-cors"), ("sec-fetch-dest", "script")),
        (("host", HOST), ("sec-fetch-site", "same-site"), ("sec-fetch-mode", "cors"), ("sec-fetch-dest", "empty")),
        (
            ("host", HOST),
            ("sec-fetch-site", "cross-site"),
            ("sec-fetch-mode", "navigate"),
            ("sec-fetch-dest", "iframe"),
        ),
    ],
)
def test_another_host_and_another_page_get_nothing(day: Path, headers: tuple[tuple[str, str], ...]) -> None:
    answer = asked(day, "/live.js", headers=headers)
    assert answer.status == 403
    assert b"this is" not in answer.body


def test_a_link_from_elsewhere_may_lead_here(day: Path) -> None:
    walked = (("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate"), ("sec-fetch-dest", "document"))
    assert asked(day, "/live.html", headers=(("host", "localhost:8750"), *walked)).status == 200
    assert asked(day, "/live.html", headers=(("host", HOST), ("origin", f"http://{HOST}"))).status == 200


@pytest.mark.parametrize(
    ("target", "cookie"),
    [
        ("/live.html", ""),
        ("/live.html?token=wrong", ""),
        (f"/live.html?token={TOKEN[:-1]}", ""),
        (f"/live.html?token={TOKEN}&token={TOKEN}", ""),
        ("/live.html?token=", ""),
        ("/live.html", f"recoil_daq_9999={TOKEN}"),
        ("/live.html", "recoil_daq_8750=wrong"),
        ("/live.html", f"xrecoil_daq_8750={TOKEN}"),
    ],
)
def test_beyond_this_computer_nothing_is_answered_without_the_token(day: Path, target: str, cookie: str) -> None:
    headers = (("host", LAN), *([("cookie", cookie)] if cookie else []))
    answer = asked(day, target, headers=headers, access=BEYOND)
    assert answer.status == 403
    assert b"this is" not in answer.body
    assert "set-cookie" not in answer.headers


def test_the_token_goes_into_a_cookie_and_out_of_the_address(day: Path) -> None:
    answer = asked(day, f"/live.html?token={TOKEN}", headers=(("host", LAN),), access=BEYOND)
    assert answer.status == 200
    assert answer.headers["set-cookie"] == f"recoil_daq_8750={TOKEN}; Path=/; HttpOnly; SameSite=Strict"
    assert b'content="0;url=/live.html"' in answer.body
    assert TOKEN.encode() not in answer.body
    kept = asked(day, "/live.html", headers=(("host", LAN), ("cookie", f"a=b; recoil_daq_8750={TOKEN}")), access=BEYOND)
    assert (kept.status, kept.body) == (200, b"this is live.html")
    # an address that leads elsewhere does so nowhere
    onward = asked(day, f'//evil.example/"><script>?token={TOKEN}', headers=(("host", LAN),), access=BEYOND)
    assert b'content="0;url=/evil.example/&quot;&gt;&lt;script&gt;"' in onward.body


@pytest.mark.parametrize("host", ["192.168.1.20:8750", "[fe80::1]:8750", "localhost:8750"])
def test_a_phone_asks_by_the_address(day: Path, host: str) -> None:
    cookie = ("cookie", f"recoil_daq_8750={TOKEN}")
    assert asked(day, "/live.html", headers=(("host", host), cookie), access=BEYOND).status == 200
    # by a name that somebody else gave to it a page of theirs could read it
    assert asked(day, "/live.html", headers=(("host", "evil.example"), cookie), access=BEYOND).status == 403


@pytest.mark.parametrize("target", ["/" + "a/" * 600, "/live.html?" + "x" * 300])
def test_an_address_that_is_too_long_is_refused(day: Path, target: str) -> None:
    assert asked(day, target).status == 414


def test_every_answer_shuts_the_page_in(day: Path) -> None:
    for target in ("/live.html", "/", "/none.html", "/reports/0001/report.html"):
        headers = asked(day, target).headers
        policy = headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self' 'sha256-")
        assert "'unsafe-inline'" not in policy.partition("style-src")[0]
        assert "frame-ancestors 'none'" in policy
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["x-content-type-options"] == "nosniff"


def test_what_was_not_changed_is_not_sent_again_but_the_state_always_is(day: Path) -> None:
    first = asked(day, "/pages/page.css")
    known = (("host", HOST), ("if-none-match", first.headers["etag"]))
    assert asked(day, "/pages/page.css", headers=known).status == 304
    (day / "pages/page.css").write_text("anew", encoding="utf-8")
    assert asked(day, "/pages/page.css", headers=known).body == b"anew"
    assert asked(day, "/live.js").headers["cache-control"] == "no-store"


def test_the_first_page_is_the_live_one_or_the_day_that_followed_it_or_a_list(day: Path) -> None:
    assert asked(day, "/").headers["location"] == "/live.html"
    (day / "day.html").write_text("the day", encoding="utf-8")
    os.utime(day / "live.html", (1e9, 1e9))
    assert asked(day, "/").headers["location"] == "/day.html"
    os.utime(day / "day.html", (9e8, 9e8))
    assert asked(day, "/").headers["location"] == "/live.html"
    (day / "live.html").unlink()
    (day / "day.html").unlink()
    (day / "index.html").write_text("all shots", encoding="utf-8")
    assert asked(day, "/").headers["location"] == "/index.html"
    (day / "index.html").unlink()
    listed = asked(day, "/").body.decode()
    assert '<a href="/reports/0001/report.html">reports/0001/report.html</a>' in listed
    assert '<a href="/reports/0001/%C3%BCmlaut%20%231%20%2541.html">' in listed
    assert "Not a safety device" in listed
    assert "secret" not in listed
    assert "hidden" not in listed


def test_a_large_file_is_sent_in_pieces_and_an_empty_one_whole(day: Path) -> None:
    (day / "plotly.min.js").write_bytes(bytes(range(256)) * 4096)
    assert asked(day, "/plotly.min.js").body == bytes(range(256)) * 4096
    (day / "empty.js").write_bytes(b"")
    assert asked(day, "/empty.js").body == b""
