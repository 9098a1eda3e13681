"""One test or more for each rule that keeps others out."""

import re

import pytest
from starlette.responses import PlainTextResponse

from steerlab.app.console import texts
from steerlab.app.console.guard import LARGEST_BODY, Guard, csrf_token
from steerlab.app.console.sign_in import (
    CODE_LENGTH,
    CODE_LETTERS,
    MOST_ADDRESSES,
    MOST_WRONG_PASSWORDS,
    LoginThrottle,
    SignIn,
)
from steerlab.study.contract import PhaseState, Standing

ORIGIN = "http://127.0.0.1:8765"
LAB_PATHS = ["/", "/checks", "/events", "/participants/P01"]
LAB_FORMS = [
    "/enrol",
    "/checks",
    *(f"/participants/P01/{act}" for act in ("link", "start", "redo", "note", "withdraw")),
]
FORM = {"content-type": "application/x-www-form-urlencoded"}


# Host and Origin


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:8765", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8765.evil", ""],
)
def test_another_host_name_is_refused(lab, host):
    _, token = lab.enrol()
    for path in ("/", f"/p/{token}", "/static/console.css"):
        answer = lab.client.get(path, headers={"host": host})
        assert answer.status_code == 421
        assert "<form" not in answer.text


def test_each_own_name_is_answered(lab):
    for host in ("127.0.0.1:8765", "localhost:8765", "LOCALHOST:8765"):
        assert lab.client.get("/static/console.css", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "http://evil.example"},
        {"origin": "http://127.0.0.1:9999"},
        {"origin": "https://127.0.0.1:8765"},
        {"origin": "null"},
        {"origin": "null", "sec-fetch-site": "cross-site"},
        {"origin": "null", "sec-fetch-site": "same-site"},
        {"sec-fetch-site": "none"},
        {},
        {"origin": "http://evil.example", "sec-fetch-site": "same-origin"},
    ],
)
def test_a_form_from_another_page_changes_nothing(lab, headers):
    who, token = lab.enrol()
    answer = lab.post(token, "/consent", headers=headers, decision="yes", version="1")
    assert answer.status_code == 403
    assert lab.study.state(who, "consent") is PhaseState.WAITING


@pytest.mark.parametrize(
    "headers", [{"origin": ORIGIN}, {"origin": "null", "sec-fetch-site": "same-origin"}]
)
def test_a_form_from_an_own_page_is_taken(lab, headers):
    who, token = lab.enrol()
    lab.post(token, "/consent", headers=headers, decision="yes", version="1")
    assert lab.study.state(who, "consent") is PhaseState.DONE


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_no_other_method_is_answered(lab, method):
    assert lab.client.request(method, "/").status_code == 405


# Form tokens


@pytest.mark.parametrize("csrf", ["", "0" * 64, "é"])
def test_every_participants_form_needs_its_token(lab, csrf):
    who, token = lab.enrol()
    for path in ("/consent", "/how/done", "/pre/1", "/pre/1/answer"):
        answer = lab.post(token, path, csrf=csrf, decision="yes", version="1", item="a", value="1")
        assert answer.status_code == 403
        assert texts.STALE_TITLE in answer.text
    assert lab.study.state(who, "consent") is PhaseState.WAITING
    assert lab.study.saves == []


def test_another_participants_form_token_does_not_fit(lab):
    who, token = lab.enrol()
    _, other = lab.enrol()
    lab.post(token, "/consent", csrf=csrf_token(other), decision="yes", version="1")
    assert lab.study.state(who, "consent") is PhaseState.WAITING


@pytest.mark.parametrize("path", LAB_FORMS)
def test_every_form_of_the_experimenters_needs_its_token(lab, path):
    lab.enrol(at="calibration")
    lab.sign_in()
    before = lab.study.changes
    answer = lab.act(
        path, csrf="no", role="test", phase="calibration", text="x", outcome="keep", typed="P01"
    )
    assert answer.status_code == 403
    assert lab.study.changes == before
    assert lab.runs.view() is None


def test_signing_out_needs_the_token_too(lab):
    lab.sign_in()
    cookie = lab.client.cookies[lab.signing.cookie]
    lab.act("/sign-out", csrf="no")
    lab.client.cookies.set(lab.signing.cookie, cookie)
    assert lab.get("/").status_code == 200


# Signing in


@pytest.mark.parametrize("path", LAB_PATHS)
def test_no_page_of_the_experimenters_opens_without_signing_in(lab, path):
    lab.enrol()
    answer = lab.get(path)
    assert answer.status_code == 401
    assert "P01" not in answer.text


@pytest.mark.parametrize("path", LAB_FORMS)
def test_no_form_of_the_experimenters_works_without_signing_in(lab, path):
    _, token = lab.enrol(at="calibration")
    before = lab.study.changes
    for csrf in (csrf_token(""), csrf_token(token)):  # a participant knows their own link
        answer = lab.act(path, csrf=csrf, role="test", outcome="erase", typed="P01")
        assert answer.status_code == 401
    assert (lab.study.changes, lab.runs.view()) == (before, None)


def test_a_sign_in_link_works_once_and_the_next_is_announced(lab):
    first = lab.links[-1]
    lab.sign_in()
    assert len(lab.links) == 2
    assert lab.links[-1] != first
    lab.client.cookies.clear()
    assert lab.client.get(f"/enter/{first}").status_code == 401
    assert lab.get("/").status_code == 401


@pytest.mark.parametrize("change", [str, str.upper, lambda code: code.replace("-", " ") + " "])
def test_the_code_of_the_link_can_be_typed(lab, change):
    code = lab.links[-1]
    answer = lab.type(code=change(code))
    assert (answer.status_code, answer.headers["location"]) == (303, lab.at("/"))
    assert lab.get("/").status_code == 200
    lab.client.cookies.clear()
    assert lab.type(code=code).status_code == 401


def test_a_code_is_beyond_guessing():
    assert len(CODE_LETTERS) ** CODE_LENGTH > 2**79
    codes = {SignIn(announce=print)._code for _ in range(100)}
    assert len(codes) == 100


def test_asking_with_head_uses_nothing_up(lab):
    who, _ = lab.enrol()
    assert lab.client.head(f"/enter/{lab.links[-1]}").status_code == 405
    lab.sign_in()  # the link still works
    shown_at = lab.act(f"/participants/{who}/link").headers["location"]
    assert lab.client.head(shown_at).status_code == 405
    assert "/p/" in lab.client.get(shown_at).text
    assert lab.client.head(lab.at("/checks")).status_code == 405
    assert lab.check_job.view().at == ""
    assert not lab.check_job.view().busy


def test_another_port_of_this_host_is_not_sent_the_cookie(lab):
    """A browser sends cookies to every port, but only where their path is."""
    lab.sign_in()
    (cookie,) = lab.client.cookies.jar
    for path in ("/", "/lab", "/lab/", "/participants/P01", lab.at("/") + "x"):
        asked = lab.client.build_request("GET", f"http://127.0.0.1:9999{path}")
        assert cookie.value not in asked.headers.get("cookie", ""), path
    asked = lab.client.build_request("GET", f"http://127.0.0.1:8765{lab.at('/checks')}")
    assert cookie.value in asked.headers["cookie"]


def test_neither_the_path_nor_the_cookie_is_enough(lab):
    lab.enrol()
    cookie = lab.sign_in()
    lab.client.cookies.clear()
    assert lab.get("/").status_code == 401
    lab.client.cookies.set(lab.signing.cookie, cookie)
    for path in ("/", "/participants/P01", "/lab/guess", "/lab/guess/participants/P01"):
        answer = lab.client.get(path)
        assert answer.status_code in (401, 404)
        assert "P01" not in answer.text
    lab.client.cookies.clear()
    lab.client.cookies.set("steerlab_experimenter", cookie)  # the name is a secret too
    assert lab.get("/").status_code == 401


def test_every_start_has_its_own_path_and_cookie():
    one, other = (SignIn(announce=print) for _ in range(2))
    assert one.home != other.home
    assert one.cookie != other.cookie


def test_a_page_from_before_a_restart_leads_to_the_sign_in(lab):
    answer = lab.client.get("/lab/older/participants/P01")
    assert answer.status_code == 401
    assert 'name="code"' in answer.text


def test_the_sessions_cookie_is_kept_from_scripts_and_other_sites(lab):
    cookie = lab.client.get(f"/enter/{lab.links[-1]}").headers["set-cookie"]
    assert {"httponly", "samesite=strict", f"path={lab.signing.home}".lower()} <= {
        part.strip().lower() for part in cookie.split(";")
    }


def test_a_session_ends_after_a_day(lab):
    lab.sign_in()
    lab.clock[0] = 12 * 3600 - 1.0
    assert lab.get("/").status_code == 200
    lab.clock[0] = 12 * 3600 + 1.0
    assert lab.get("/").status_code == 401


def test_without_a_password_file_no_password_lets_in(lab):
    for password in ("", "password"):
        assert lab.type(password=password).status_code == 401
    assert "password" not in lab.client.get("/").text


# Guessing


def test_guessing_links_is_slowed_down(lab):
    for _ in range(20):
        assert lab.client.get("/p/guess").status_code == 404
    answer = lab.client.get("/p/guess")
    assert answer.status_code == 429
    assert int(answer.headers["retry-after"]) == 60
    _, token = lab.enrol()
    assert lab.client.get(f"/p/{token}").status_code == 429  # right or wrong is not told
    lab.clock[0] = 61.0
    assert lab.client.get(f"/p/{token}").status_code == 200


def test_guessing_does_not_lock_out_who_is_in(lab):
    who, token = lab.enrol(at="pre")
    lab.client.get(f"/p/{token}")
    for _ in range(25):
        lab.client.get("/p/guess")
    assert lab.post(token, "/pre/1/answer", item="age", value="30").status_code == 204
    assert lab.study.answers(who, "pre", "demographics") == {"age": 30}


def test_guessing_sign_in_links_and_passwords_is_slowed_down(lab):
    for _ in range(10):
        assert lab.client.get("/enter/guess").status_code == 401
        assert lab.type(password="guess").status_code == 401
    assert lab.client.get("/enter/guess").status_code == 429
    assert lab.type(password="guess").status_code == 429


def test_the_experimenter_gets_in_whoever_guesses_and_however_often(lab):
    for _ in range(30):
        lab.client.get("/enter/guess")
        lab.client.get("/p/guess")
        lab.type(password="guess")
        lab.type(code="guess")
    assert lab.type(code="guess").status_code == 429
    assert lab.client.get(f"/enter/{lab.links[-1]}").status_code == 303
    lab.client.cookies.clear()
    assert lab.type(code=lab.links[-1]).status_code == 303


def test_wrong_links_of_participants_do_not_slow_the_experimenters_sign_in(lab):
    for _ in range(25):
        lab.client.get("/p/guess")
    assert lab.type(password="guess").status_code == 401


def test_passwords_are_not_guessed_faster_from_many_places():
    now = [0.0]
    throttle = LoginThrottle(clock=lambda: now[0])
    tried = 0
    for number in range(10 * MOST_ADDRESSES):
        source = f"sign-in 10.0.{number // 256}.{number % 256}"
        if not throttle.password_wait_s(source):
            throttle.wrong_password(source)
            tried += 1
    assert tried == MOST_WRONG_PASSWORDS
    now[0] = 61.0
    assert throttle.password_wait_s("sign-in 10.0.0.1") == 0


def test_a_link_that_was_just_made_waits_for_nobodys_guesses(lab):
    lab.sign_in()
    who, _ = lab.enrol()
    shown = lab.client.get(lab.act(f"/participants/{who}/link").headers["location"]).text
    token = re.search(r"/p/([\w-]+)", shown).group(1)
    for _ in range(25):
        lab.client.get("/p/guess")
    assert lab.client.get("/p/guess").status_code == 429
    assert lab.client.get(f"/p/{token}").status_code == 200


def test_a_forwarded_address_does_not_count(lab):
    for number in range(20):
        lab.client.get("/p/guess", headers={"x-forwarded-for": f"10.0.0.{number}"})
    assert lab.client.get("/p/guess", headers={"x-forwarded-for": "10.9.9.9"}).status_code == 429


def test_a_link_of_absurd_length_never_reaches_the_study(lab, monkeypatch):
    monkeypatch.setattr(lab.study, "participant_of", None)
    assert lab.client.get("/p/" + "a" * 5000).status_code == 404


# One participant's link shows nothing of another's


def test_a_link_shows_and_changes_its_own_participant_only(lab):
    first, token = lab.enrol(at="pre")
    second, other = lab.enrol(at="pre")
    lab.post(other, "/pre/1/answer", item="age", value="77")
    page = lab.client.get(f"/p/{token}/pre/1").text
    assert 'value="77"' not in page
    assert 'value="77"' in lab.client.get(f"/p/{other}/pre/1").text
    assert not re.search(rf"\b({first}|{second})\b", page)
    lab.post(token, "/pre/1/answer", item="age", value="20", participant=second)
    assert lab.study.answers(second, "pre", "demographics") == {"age": 77}
    assert lab.study.answers(first, "pre", "demographics") == {"age": 20}


# Headers


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/"),
        ("GET", "/p/guess"),
        ("GET", "/nothing"),
        ("GET", "/static/console.css"),
        ("GET", "/static/nothing"),
        ("PUT", "/"),
        ("POST", "/enrol"),
        ("GET", "/enrol"),
    ],
)
def test_every_answer_carries_the_headers(lab, method, path):
    headers = lab.client.request(method, path).headers
    policy = dict(
        part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";")
    )
    assert policy == {
        "default-src": "'none'",
        "script-src": "'self'",
        "style-src": "'self'",
        "connect-src": "'self'",
        "form-action": "'self'",
        "frame-ancestors": "'none'",
        "base-uri": "'none'",
    }
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == ("no-cache" if path.endswith(".css") else "no-store")
    assert "access-control-allow-origin" not in headers


def test_with_tls_alone_browsers_are_told_to_keep_to_it(lab):
    async def app(scope, receive, send):
        await PlainTextResponse("")(scope, receive, send)

    for scheme in ("http", "https"):
        origin = f"{scheme}://lab-pc.local"
        guarded = Guard(app, origins=(origin,))
        headers = type(lab.client)(guarded, base_url=origin).get("/").headers
        assert ("strict-transport-security" in headers) == (scheme == "https")


def test_no_page_asks_for_anything_outside_or_inline(lab):
    _, token = lab.enrol(at="pre")
    lab.enrol(at="practice")
    lab.sign_in()
    paths = [lab.at(path) for path in ("/", "/participants/P01", "/checks")]
    paths += ["/", f"/p/{token}/pre/1", f"/p/{token}/pre/2"]
    for path in paths:
        page = lab.client.get(path).text
        assert re.findall(r'(?:src|href|action)="(?!/|#)[^"]*', page) == []
        assert not re.search(r"<style|\sstyle=|\son\w+=|javascript:", page)
        assert re.findall(r"<script(?! src=\"/static/)", page) == []


# Files and bodies


@pytest.mark.parametrize(
    "path",
    [
        "/static/../texts.py",
        "/static/%2e%2e/texts.py",
        "/static/..%2ftexts.py",
        "/static/%2fetc%2fpasswd",
        "/static/console.css%00",
        "/static/",
        "/templates/base.html.j2",
    ],
)
def test_no_path_leads_to_a_file(lab, path):
    answer = lab.client.get(path)
    assert answer.status_code == 404
    assert "Every word" not in answer.text


def test_static_files_are_not_sent_twice(lab):
    tag = lab.client.get("/static/console.css").headers["etag"]
    again = lab.client.get("/static/console.css", headers={"if-none-match": tag})
    assert (again.status_code, again.content) == (304, b"")


def test_a_long_body_is_refused_unread(lab):
    who, token = lab.enrol()
    answer = lab.post(token, "/consent", decision="yes", version="1", more="a" * LARGEST_BODY)
    assert answer.status_code == 413
    assert lab.study.state(who, "consent") is PhaseState.WAITING


@pytest.mark.parametrize("length", ["9" * 5000, "-1", "1e3", "²"])
def test_a_length_that_is_no_number_is_refused(lab, length):
    sent = {"origin": ORIGIN, **FORM, "content-length": length.encode("latin-1")}
    assert lab.client.post("/sign-in", headers=sent).status_code == 413


def test_a_long_body_without_a_length_is_refused_too(lab):
    _, token = lab.enrol()
    answer = lab.client.post(
        f"/p/{token}/consent",
        content=(b"a" * 1024 for _ in range(200)),
        headers={"origin": ORIGIN, **FORM},
    )
    assert answer.status_code == 413


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"decision=yes&decision=no", 400),
        (b"decision=%ff", 400),
        ("decision=ü".encode(), 400),
        (b"&".join(b"f%d=1" % n for n in range(400)), 400),
        (b"", 403),
        (b"\x00\x01", 403),
    ],
)
def test_what_is_no_form_is_refused(lab, body, status):
    who, token = lab.enrol()
    answer = lab.client.post(
        f"/p/{token}/consent", content=body, headers={"origin": ORIGIN, **FORM}
    )
    assert answer.status_code == status
    assert lab.study.participant(who).standing is Standing.ENROLLED


@pytest.mark.parametrize("kind", ["multipart/form-data; boundary=x", "application/json", ""])
def test_only_plain_forms_are_read(lab, kind):
    _, token = lab.enrol()
    answer = lab.client.post(
        f"/p/{token}/consent",
        content=b"decision=yes",
        headers={"origin": ORIGIN, "content-type": kind},
    )
    assert answer.status_code == 415
