"""A replay leaves a page usable where pictures are drawn slowly, as in this browser, which has no graphics card."""

import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

from terrain.viewer.replay.replay_page import replay_html

READY = "window.replay !== undefined && replay.used !== undefined && !replay.dirty && !replay.coarse"
SIDES = "[replay.canvas.width, replay.canvas.clientWidth, replay.pace.software]"


def test_a_picture_that_moves_is_coarser_without_a_graphics_card_and_sharp_once_it_stands(
    chromium, hill_recording, tmp_path
):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined && replay.coarse")
        moving = await page.evaluate(SIDES)
        await page.key(" ")
        await page.wait_for(READY)
        return page.errors, moving, await page.evaluate(SIDES)

    errors, moving, standing = chromium.visit(watch)

    assert errors == []
    assert moving[2], "this browser draws in software"
    assert moving[0] < 0.6 * moving[1]
    assert standing[0] == standing[1]


def test_frames_decide_how_sharp_a_moving_picture_is(chromium, hill_recording, tmp_path):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")
    paces = """[10, 200, 40, 10].map(milliseconds => {
      const {pace} = replay;
      let now = performance.now() + 1000;
      for (let frame = 0; frame < 60; frame++) pace.note(now, now += milliseconds);
      return [pace.sharpness, pace.ready > now]; })"""

    async def watch(page):
        await page.open((tmp_path / "replay.html").as_uri())
        await page.wait_for("window.replay !== undefined")
        await page.key(" ")
        await page.wait_for(READY)
        return await page.evaluate(paces)

    quick, slow, middling, again = chromium.visit(watch)

    assert quick == [1, False], "as sharp as one that stands, and no rest between frames"
    assert slow == [0.4, True], "as coarse as it gets, and the page rests between frames"
    assert middling == [0.4, False], "it stays as it is, or it would change back and forth"
    assert again == [1, False]


def test_a_replay_in_a_page_waits_to_be_played_without_a_graphics_card_and_only_moves_while_it_is_seen(
    chromium, hill_recording, tmp_path
):
    (tmp_path / "replay.html").write_text(replay_html(hill_recording), encoding="utf-8")
    frame = '<iframe id="run" src="replay.html" width="700" height="400"></iframe>'
    html = f"<!doctype html><link rel='icon' href='data:,'>{frame}<div style='height: 3000px'></div>"
    inside = "document.getElementById('run').contentWindow.replay"

    class Folder(SimpleHTTPRequestHandler):
        def __init__(self, *arguments):
            super().__init__(*arguments, directory=tmp_path)

        def log_message(self, *arguments):
            pass

    (tmp_path / "index.html").write_text(html)
    with ThreadingHTTPServer(("127.0.0.1", 0), Folder) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()

        async def watch(page):
            await page.open(f"http://127.0.0.1:{server.server_port}/index.html")
            await page.wait_for(f"{inside} !== undefined && {inside}.used !== undefined")
            waiting = await page.evaluate(f"[{inside}.player.playing, {inside}.player.time]")
            await page.evaluate(f"{inside}.player.toggle()")
            await page.wait_for(f"{inside}.player.time > 0.5")
            await page.evaluate("window.scrollTo(0, 2500)")
            await page.wait_for(f"!{inside}.seen")
            hidden = await page.evaluate(f"""(async () => {{
              const before = {inside}.player.time, ticks = 20;
              for (let k = 0; k < ticks; k++) await new Promise(requestAnimationFrame);
              return [before, {inside}.player.time]; }})()""")
            await page.evaluate("window.scrollTo(0, 0)")
            await page.wait_for(f"{inside}.player.time > {hidden[0]} + 0.5")
            return page.errors, waiting, hidden

        errors, waiting, hidden = chromium.visit(watch)
        server.shutdown()

    assert errors == []
    assert waiting == [False, 0]
    assert hidden[0] == hidden[1]
