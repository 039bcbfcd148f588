"""The studio as its user sees it, in Debian's Chromium (apt-get install chromium; else these are skipped)."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest
from engine_processes import find_engines
from playwright.sync_api import Page, Request, Route, expect, sync_playwright

from evaps.dsl.interpreter import Limits

from .conftest import TASKS

CHROMIUM = shutil.which("chromium")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium here")]
QUIET = "--no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-component-update"
ENDLESS = """def run():
    if is_there(Demon):
        while is_there(Demon):
            if not is_there(Demon):
                turn_left()
    else:
        while not is_there(Demon):
            if is_there(Demon):
                turn_left()
"""
SECONDS = 10_000  # milliseconds: other tests may have both cores


@pytest.fixture(scope="module")
def pages(address: str) -> Iterator[Page]:
    """One page for all tests of this file; each goes on from where it is."""
    expect.set_options(timeout=SECONDS)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET.split())
        page = browser.new_page(viewport={"width": 1280, "height": 1400})
        page.set_default_timeout(SECONDS)
        page.goto(address)
        yield page
        browser.close()


@pytest.fixture
def page(pages: Page) -> Iterator[Page]:
    """The page, on which nothing goes wrong that it does not say."""
    wrong: list[str] = []
    pages.on("pageerror", lambda error: wrong.append(str(error)))
    refused = "status of 422"  # which the page says itself
    pages.on(
        "console",
        lambda said: wrong.append(said.text) if said.type == "error" and refused not in said.text else None,
    )
    yield pages
    assert not wrong


def middle_of(page: Page, thing: str) -> tuple[float, float]:
    """Where a thing of the map is on the page."""
    box = page.locator(f"[aria-label^='{thing}']").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_somebody_drives_and_keeps_an_example(page: Page) -> None:
    expect(page.locator("#perceptions li.true").first).to_be_visible()
    page.get_by_role("button", name="turn left", exact=True).click()
    expect(page.locator("#time-text")).to_have_text("1 of 1")
    page.keyboard.press("w")
    expect(page.locator("#time-text")).to_have_text("2 of 2")
    expect(page.locator("#driven")).to_have_text("turn left, ahead")
    page.get_by_role("button", name="Keep this as an example").click()
    expect(page.locator("#examples li.filled")).to_have_count(1)


def test_a_thing_is_moved_with_the_mouse_and_with_keys(page: Page) -> None:
    demon = page.get_by_role("button", name="Demon 1")
    box = demon.bounding_box()
    assert box is not None
    seen = page.locator("#rgb").get_attribute("src")
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 60, box["y"] - 80, steps=4)
    expect(page.locator("#rgb")).not_to_have_attribute("src", str(seen))  # while it is still in the hand
    page.mouse.up()
    expect(page.locator("#time-text")).to_have_text("0 of 0")
    where = str(demon.get_attribute("aria-label"))
    demon.focus()
    page.keyboard.press("ArrowLeft")
    expect(page.locator("[aria-label^='Demon 1']")).not_to_have_attribute("aria-label", where)
    page.keyboard.press("Delete")
    expect(page.locator("[aria-label^='Demon 1']")).to_have_count(0)
    expect(page.locator("#perceptions li.true")).to_have_count(0)


def test_a_click_on_a_thing_changes_nothing(page: Page) -> None:
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("button", name="+ Demon").click()
    expect(page.locator("#world.stale")).to_have_count(0)
    for _ in range(3):
        page.get_by_role("button", name="turn left", exact=True).click()
    expect(page.locator("#time-text")).to_have_text("3 of 3")
    page.locator("[aria-label^='Demon 1']").click()
    expect(page.locator("[aria-label^='Demon 1']")).to_be_focused()
    expect(page.locator("#time-text")).to_have_text("3 of 3")
    expect(page.locator("#driven")).to_have_text("turn left, turn left, turn left")
    page.locator("[aria-label^='Demon 1']").press("Delete")
    page.get_by_role("button", name="Start anew").click()


def test_tab_stops_once_on_the_map(page: Page) -> None:
    """However many things there are: N and P go from one to the next."""
    for kind in ("Demon", "Revenant"):
        page.get_by_role("button", name=f"+ {kind}").click()
    things = page.locator("#map .thing")
    number = things.count()
    assert number == 3
    robot = page.locator("[aria-label^='The robot']")
    robot.focus()
    for key, index in (("n", 0), ("n", 1), ("p", 0), ("p", number - 1)):
        page.keyboard.press(key)
        expect(things.nth(index)).to_be_focused()
        expect(page.locator("#map [tabindex='0']")).to_have_count(1)
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.closest('#map')") is None
    page.keyboard.press("Shift+Tab")
    expect(robot).to_be_focused()
    for kind in ("Demon", "Revenant"):
        page.locator(f"[aria-label^='{kind}']").press("Delete")


def test_what_is_chosen_is_turned_and_taken_away_with_buttons(page: Page) -> None:
    page.get_by_role("button", name="+ Clip").click()
    page.locator("[aria-label^='The robot']").focus()
    expect(page.locator("#picked")).to_have_text("the robot")
    expect(page.locator("#take-it")).to_be_hidden()
    page.get_by_role("button", name="Turn it right").click()
    expect(page.locator("[aria-label^='The robot, heading 345 degrees']")).to_be_visible()
    page.get_by_role("button", name="Turn it left").click()
    page.get_by_role("button", name="Turn it left").click()
    expect(page.locator("[aria-label^='The robot, heading 15 degrees']")).to_be_visible()
    page.get_by_role("button", name="Turn it right").click()
    page.locator("[aria-label^='Clip 1']").click()
    expect(page.locator("#picked")).to_have_text("Clip 1")
    expect(page.locator("#turn-it-left")).to_be_hidden()
    page.get_by_role("button", name="Take it away").click()
    expect(page.locator("[aria-label^='Clip']")).to_have_count(0)
    expect(page.locator("#picked")).to_have_text("the robot")


def test_a_finger_drags_things(address: str, pages: Page) -> None:
    """As on a phone, without a mouse."""
    phone = pages.context.browser
    assert phone is not None
    page = phone.new_page(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page.goto(address)
    demon = page.locator("[aria-label^='Demon 1']")
    expect(page.locator("#perceptions li").first).to_be_visible()
    where = str(demon.get_attribute("aria-label"))
    demon.scroll_into_view_if_needed()
    box = demon.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    finger = page.context.new_cdp_session(page)
    for kind, to in (("touchStart", 0), ("touchMove", -20), ("touchMove", -40), ("touchEnd", None)):
        points = [] if to is None else [{"x": x, "y": y + to}]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    expect(demon).not_to_have_attribute("aria-label", where)
    moved = demon.bounding_box()
    assert moved is not None
    assert moved["y"] - box["y"] == pytest.approx(-40, abs=2), "to where the finger left it"
    page.get_by_role("button", name="turn left", exact=True).tap()
    expect(page.locator("#time-text")).to_have_text("1 of 1")
    page.close()


def test_a_task_that_is_drawn_with_the_mouse_is_solved(page: Page) -> None:
    """Five scenes, the demon somewhere else in each, and the robot is driven by hand."""
    page.get_by_role("button", name="+ Demon").click()
    for number in range(5):
        x, y = middle_of(page, "Demon 1")
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + (30 if number % 2 else -30), y + 12 * number - 20, steps=3)
        page.mouse.up()
        expect(page.locator("#world.stale")).to_have_count(0)
        for times, name in enumerate(("turn left", "turn left", "ahead"), 1):
            page.get_by_role("button", name=name, exact=True).click()
            expect(page.locator("#time-text")).to_have_text(f"{times} of {times}")
        page.get_by_role("button", name="Keep this as an example").click()
        expect(page.locator("#examples li.filled")).to_have_count(number + 1)
    page.get_by_label("for at most").fill("60")
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#verdict")).to_contain_text("It reaches all five goals", timeout=6 * SECONDS)
    expect(page.locator("#found")).to_contain_text("move_forward()")
    page.get_by_role("button", name="Start anew").click()


def test_a_program_is_written_and_told_where_it_is_wrong(page: Page) -> None:
    page.get_by_role("tab", name="Program").click()
    page.locator("#code").fill("def run():\n    jump()\n")
    expect(page.locator("#code-error")).to_contain_text("line 2, column 5")
    expect(page.locator("#lines .wrong")).to_have_text("    jump()")
    page.locator("#code").fill("def run():\n    turn_left()\n    attack()\n")
    expect(page.locator("#code-error")).to_be_empty()
    page.get_by_role("button", name="Run it here").click()
    expect(page.locator("#time-text")).to_have_text("0 of 2")
    expect(page.locator("#lines .at")).to_have_text("    turn_left()")
    page.locator("#time").press("ArrowRight")
    expect(page.locator("#lines .at")).to_have_text("    attack()")


def test_a_program_that_never_ends_is_told(page: Page) -> None:
    page.locator("#code").fill(ENDLESS)
    page.get_by_role("button", name="Run it here").click()
    expect(page.locator("#now")).to_have_text("stopped: too many steps")
    expect(page.get_by_role("button", name="Keep this as an example")).to_be_disabled()


def test_a_wrong_program_does_not_keep_another_scene_on_the_map(page: Page) -> None:
    page.locator("#code").fill("def run():\n    turn_left()\n")
    expect(page.locator("#code-error")).to_be_empty()
    page.get_by_role("button", name="Make five examples of it").click()
    expect(page.locator("#examples li.filled")).to_have_count(5)
    page.locator("#code").fill("def run():\n    jump()\n")
    for number in (1, 4):
        before = page.locator("[aria-label^='The robot']").get_attribute("aria-label")
        page.locator("#examples li").nth(number).get_by_role("button", name="Go there").click()
        expect(page.locator("#message")).to_contain_text("jump")
        expect(page.locator("[aria-label^='The robot']")).not_to_have_attribute("aria-label", str(before))
    page.locator("#code").fill("def run():\n    turn_left()\n    attack()\n")
    page.get_by_role("button", name="Start anew").click()


def test_five_examples_become_a_program(page: Page) -> None:
    page.get_by_role("button", name="Make five examples of it").press("Enter")
    expect(page.locator("#examples li.filled")).to_have_count(5)
    expect(page.get_by_role("button", name="Make five examples of it")).to_be_focused()
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#verdict")).to_contain_text("It reaches all five goals", timeout=6 * SECONDS)
    expect(page.locator("#found")).to_contain_text("def run():")
    expect(page.locator("#examples .yes")).to_have_count(5)
    assert page.locator("#log li").count() > 1
    below = page.locator("#log").evaluate("log => log.scrollHeight - log.clientHeight - log.scrollTop")
    assert abs(below) <= 1, "the latest news is in sight"
    page.get_by_role("button", name="Put it into the editor").click()
    expect(page.locator("#code")).to_have_value(page.locator("#found").inner_text())


def test_what_is_driven_while_a_scene_is_on_its_way_is_driven_in_that_scene(page: Page) -> None:
    held: list[Route] = []
    page.get_by_role("tab", name="Drive").click()
    page.route("**/api/random-scene", lambda route: held.append(route))
    with page.expect_request("**/api/random-scene"):
        page.get_by_role("button", name="Random scene").click()
    for _ in range(2):
        page.get_by_role("button", name="turn left", exact=True).click()
    held[0].continue_()
    expect(page.locator("#time-text")).to_have_text("2 of 2")
    expect(page.locator("#driven")).to_have_text("turn left, turn left")
    page.unroute("**/api/random-scene")


def test_space_presses_the_button_that_has_the_focus(page: Page) -> None:
    page.get_by_role("button", name="Start again").click()
    page.get_by_role("button", name="turn left", exact=True).focus()
    page.keyboard.press("Space")
    expect(page.locator("#driven")).to_have_text("turn left")
    page.keyboard.press("f")
    expect(page.locator("#driven")).to_have_text("turn left, shoot")


def test_what_is_driven_is_kept_where_it_was_driven(page: Page) -> None:
    keep = page.get_by_role("button", name="Keep this as an example")
    page.get_by_role("button", name="Start anew").click()
    page.get_by_role("tab", name="Program").click()
    page.locator("#code").fill("def run():\n    move_left()\n")
    page.get_by_role("tab", name="Drive").click()
    expect(keep).to_be_enabled()
    page.get_by_role("tab", name="Program").click()
    expect(keep).to_be_disabled()
    page.get_by_role("tab", name="Drive").click()
    expect(keep).to_be_enabled()


def test_one_action_too_many_is_refused(page: Page) -> None:
    page.get_by_role("button", name="Start again").click()
    most = Limits().actions
    for _ in range(most + 1):
        page.get_by_role("button", name="turn left", exact=True).click()
    expect(page.locator("#message")).to_contain_text(f"{most} actions are the most")
    expect(page.locator("#time-text")).to_have_text(f"{most} of {most}")
    expect(page.get_by_role("button", name="Keep this as an example")).to_be_enabled()


def test_nothing_is_searched_for_while_other_examples_are_on_their_way(page: Page) -> None:
    held: list[Route] = []
    page.get_by_role("button", name="Random test task").click()
    expect(page.get_by_role("button", name="Synthesize")).to_be_enabled()
    page.route("**/api/random-task", lambda route: held.append(route))
    with page.expect_request("**/api/random-task"):
        page.get_by_role("button", name="Random test task").click()
    for name in ("Synthesize", "Start anew", "Save the task"):
        expect(page.get_by_role("button", name=name)).to_be_disabled()
    held[0].continue_()
    expect(page.get_by_role("button", name="Synthesize")).to_be_enabled()
    page.unroute("**/api/random-task")


def test_the_focus_goes_to_what_comes_next(page: Page) -> None:
    """A button that cannot be pressed any longer loses it, and Tab would begin at the top of the page."""
    page.get_by_role("button", name="Start anew").click()
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("button", name="Start again").click()
    page.get_by_role("button", name="turn left", exact=True).click()
    expect(page.locator("#time-text")).to_have_text("1 of 1")
    for _ in range(5):
        page.get_by_role("button", name="Keep this as an example").press("Enter")
    expect(page.get_by_role("button", name="Synthesize")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("#verdict")).to_be_focused(timeout=6 * SECONDS)
    expect(page.locator("#verdict")).to_contain_text("It reaches all five goals")


def test_a_search_is_stopped(page: Page) -> None:
    """Five views that are no program's ends: it does not end by itself."""
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("button", name="Start anew").click()
    for number in range(5):
        page.get_by_role("button", name="Random scene").click()
        expect(page.locator("#world.stale")).to_have_count(0)
        for _ in range(12 + number):
            page.get_by_role("button", name="turn left", exact=True).click()
        expect(page.locator("#time-text")).to_have_text(f"{12 + number} of {12 + number}")
        page.get_by_role("button", name="Keep this as an example").click()
        expect(page.locator("#examples li.filled")).to_have_count(number + 1)
    page.get_by_label("for at most").fill("300")
    page.get_by_label("simulated actions").fill("100000")
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#log li").first).to_be_visible(timeout=6 * SECONDS)
    page.get_by_role("button", name="Stop").click()
    expect(page.locator("#verdict")).to_contain_text("Stopped; the best so far", timeout=6 * SECONDS)
    expect(page.get_by_role("button", name="Synthesize")).to_be_enabled()
    page.get_by_label("for at most").fill("60")
    page.get_by_role("button", name="Start anew").click()


def test_an_engine_that_was_replaced_is_told(page: Page) -> None:
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("button", name="Start again").click()
    for engine in find_engines(os.getpid()):
        os.kill(engine, signal.SIGKILL)
    page.get_by_role("button", name="turn left", exact=True).click()
    expect(page.locator("#message")).to_contain_text("a new one has taken its place")
    expect(page.locator("#time-text")).to_have_text("1 of 1")
    page.reload()
    expect(page.locator("#perceptions li").first).to_be_visible()
    expect(page.locator("#message")).to_be_hidden()


def test_a_task_is_loaded_and_saved(page: Page) -> None:
    page.get_by_label("Load").select_option(TASKS[0].name)
    expect(page.locator("#task-name")).to_have_value(TASKS[0].name)
    expect(page.locator("#examples img[src]")).to_have_count(10)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save the task").click()
    assert download.value.suggested_filename == f"{TASKS[0].name}.zip"


def test_a_random_task_is_drawn_and_worked_on_for_as_much_as_is_said(page: Page) -> None:
    page.get_by_role("button", name="Random test task").click()
    expect(page.locator("#task-name")).to_have_value(re.compile("random-"))
    expect(page.locator("#examples img[src]")).to_have_count(10)
    page.get_by_label("simulated actions").fill("150")
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#verdict")).to_be_visible(timeout=6 * SECONDS)
    expect(page.locator("#progress")).to_contain_text("of 150 actions")


def test_examples_outlive_a_reload(page: Page) -> None:
    page.reload()
    expect(page.locator("#examples img[src]")).to_have_count(10)
    expect(page.get_by_role("button", name="Synthesize")).to_be_enabled()


def test_a_search_begins_anew_after_a_reload(page: Page) -> None:
    """The one that was left behind makes room."""
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#progress")).not_to_be_empty()
    page.reload()
    page.get_by_role("button", name="Synthesize").click()
    expect(page.locator("#verdict")).to_be_visible(timeout=6 * SECONDS)


def test_the_view_is_of_where_a_thing_is_held(page: Page) -> None:
    page.get_by_role("tab", name="Drive").click()
    expect(page.locator("#world.stale")).to_have_count(0)
    looked_at: list[Request] = []
    answered: list[Request] = []

    def note(request: Request, where: list[Request]) -> None:
        if request.url.endswith("/api/run"):
            where.append(request)

    page.on("request", lambda request: note(request, looked_at))
    page.on("requestfinished", lambda request: note(request, answered))
    x, y = middle_of(page, "Demon 1")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(12):  # quicker than views come
        page.mouse.move(x - 6 * step, y + 4 * step)
    page.wait_for_timeout(300)
    while len(answered) < len(looked_at):
        page.wait_for_timeout(300)
    held = looked_at[-1]
    with page.expect_request("**/api/run"):
        page.mouse.up()
    assert looked_at[-1] != held
    assert looked_at[-1].post_data_json["scene"] == held.post_data_json["scene"]
    expect(page.locator("#world.stale")).to_have_count(0)


def test_what_is_held_goes_when_another_scene_comes(page: Page) -> None:
    held: list[Route] = []
    page.route("**/api/random-scene", lambda route: held.append(route))
    with page.expect_request("**/api/random-scene"):
        page.get_by_role("button", name="Random scene").click()
    page.mouse.move(*middle_of(page, "The robot"))
    page.mouse.down()
    before = page.locator("[aria-label^='The robot']").get_attribute("aria-label")
    with page.expect_response("**/api/run"):
        held[0].continue_()
    page.mouse.up()
    expect(page.locator("[aria-label^='The robot']")).not_to_have_attribute("aria-label", str(before))
    page.unroute("**/api/random-scene")


@pytest.mark.parametrize("width", [390, 768, 1280])
def test_nothing_sticks_out_at_any_width(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width


@pytest.fixture(scope="module")
def karel() -> Iterator[str]:
    """The address of a studio in which there is Karel instead of the Doom robot."""
    command = [sys.executable, "-m", "evaps", "studio", "--port", "0"]
    with subprocess.Popen(
        command, env={**os.environ, "EVAPS_DOMAIN": "karel"}, stdout=subprocess.PIPE, text=True
    ) as studio:
        assert studio.stdout is not None
        yield studio.stdout.readline().split()[2]
        studio.send_signal(signal.SIGINT)


def test_karel_is_driven_and_runs_programs(page: Page, karel: str) -> None:
    page.goto(karel)
    expect(page.locator("#perceptions")).to_contain_text("no markers present: yes")
    expect(page.locator("#depth")).to_be_hidden()
    expect(page.locator("#map .grid")).to_have_count(34)
    expect(page.locator("#map rect.Wall").first).to_be_visible()
    expect(page.locator("#map .beyond")).to_have_count(2)
    page.get_by_role("button", name="put marker", exact=True).click()
    expect(page.locator("#map .put .Marker")).to_have_count(1)
    page.keyboard.press("4")
    expect(page.locator("#driven")).to_have_text("put marker, turn left")
    expect(page.locator("#perceptions li.true")).to_contain_text(["markers present: yes"])
    page.get_by_role("tab", name="Program").click()
    page.locator("#code").fill("def run():\n    while front_is_clear():\n        move()\n")
    page.get_by_role("button", name="Run it here").click()
    expect(page.locator("#now")).to_have_text("next: move")
    page.locator("#time").press("End")
    expect(page.locator("#perceptions")).to_contain_text("front is clear: no")
