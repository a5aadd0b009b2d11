// Runs in the page of every visitor of the live view, see visitor_channel.py. Reports the pointer, drags and the stick;
// shows the values under the pointer, the buttons of the camera and, to those who may steer, the stick.
(path) => {
  "use strict";
  if (window.mbfVisitor) window.mbfVisitor.close();
  const SEND_EVERY = 100; // ms; the pointer. The stick is reported at each heartbeat
  const LEAST_DRAG = 8; // pixels; less is a click
  const GOING_AWAY = 1001; // WebSocket close code of a server that ends
  const PAD = 55; // pixels; half the side of the stick's field
  const KEYS = { KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1],
                 KeyA: [1, 0], ArrowLeft: [1, 0], KeyD: [-1, 0], ArrowRight: [-1, 0] }; // turn, forward

  const listening = new AbortController();
  const listen = (target, type, handler) =>
    target.addEventListener(type, handler, { capture: true, passive: false, signal: listening.signal });
  const base = location.href.split(/[?#]/)[0].replace(/[^/]*$/, "").replace(/^http/, "ws");
  const socket = new WebSocket(base + path);
  const send = (message) => { if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); };

  // ---------------------------------------------------------------------------------------- what is shown
  const element = (parent, name, style, attributes = {}) => {
    const made = parent.appendChild(document.createElement(name));
    made.style.cssText = style;
    return Object.assign(made, attributes);
  };
  const CARD = "background:rgba(255,255,255,0.9);border-radius:6px;box-shadow:0 1px 4px rgba(0,0,0,0.25);" +
    "color:#1f2328;font:12px/1.5 system-ui,sans-serif;pointer-events:auto;user-select:none;";
  const root = element(document.body, "div", "position:fixed;pointer-events:none;z-index:1;overflow:hidden;");
  root.id = "mbf-visitor";
  const bar = element(root, "div", "position:absolute;top:10px;left:50%;transform:translateX(-50%);display:flex;" +
    "gap:2px;padding:3px;" + CARD);
  const notice = element(root, "div", "position:absolute;top:60px;left:50%;transform:translateX(-50%);padding:8px 14px;" +
    "font-size:14px;display:none;" + CARD);
  notice.id = "mbf-notice";
  const readout = element(root, "div", "position:absolute;left:10px;bottom:10px;padding:4px 8px;display:none;" + CARD);
  readout.id = "mbf-values";
  const SVG = "http://www.w3.org/2000/svg";
  const drawing = root.appendChild(document.createElementNS(SVG, "svg"));
  drawing.style.cssText = "position:absolute;inset:0;width:100%;height:100%;pointer-events:none;";
  const arrow = drawing.appendChild(document.createElementNS(SVG, "path"));
  for (const [name, value] of Object.entries({ fill: "none", stroke: "#c81450", "stroke-width": 4,
    "stroke-linecap": "round" })) arrow.setAttribute(name, value);

  const button = (label, title, onPress) => {
    const made = element(bar, "button", "border:0;border-radius:4px;padding:3px 9px;background:none;cursor:pointer;" +
      "font:inherit;color:inherit;", { textContent: label, title });
    made.onclick = (event) => { onPress(made); made.blur(); event.stopPropagation(); };
    return made;
  };
  const press = (made, on) => {
    made.style.background = on ? "#1f6feb" : "none";
    made.style.color = on ? "#fff" : "inherit";
    made.setAttribute("aria-pressed", String(on));
  };
  const views = [["free", "Turn, move and zoom as you like"], ["follow", "The camera moves with the robot"],
    ["overview", "All of the route"], ["storey", "The robot's storey from above, without what is over it"]];
  const viewButtons = views.map(([view, title]) => button(view[0].toUpperCase() + view.slice(1), title, (made) => {
    for (const other of viewButtons) press(other, other === made);
    send({ look: view });
  }));
  press(viewButtons[0], true);

  const graph = element(root, "div", "position:absolute;left:10px;right:10px;top:48px;max-height:45%;overflow:auto;" +
    "display:none;" + CARD);
  graph.id = "mbf-tree";
  press(button("Tree", "The behaviour tree as a graph", (made) => {
    const shows = graph.style.display === "none";
    graph.style.display = shows ? "block" : "none";
    press(made, shows);
  }), false);
  const showTree = (svg) => {
    graph.innerHTML = svg; // made by the server, its texts escaped there
    if (!svg) element(graph, "div", "padding:8px;", { textContent:
      "No behaviour tree runs; start with --executive navigation to see one." });
  };

  let values = [], placing = ""; // under the pointer, and what a click there places as far as the server knows
  const showReadout = () => {
    const rows = steers && values.length ? [...values, ["a click is", placing, ""]] : values;
    readout.style.display = rows.length ? "block" : "none";
    readout.replaceChildren();
    for (const [name, value, colour] of rows) {
      const row = element(readout, "div", "display:flex;gap:6px;align-items:center;");
      element(row, "span", `width:9px;height:9px;border-radius:2px;background:${colour || "none"};`);
      element(row, "span", "flex:1;", { textContent: name });
      element(row, "b", "font-variant-numeric:tabular-nums;padding-left:10px;", { textContent: value });
    }
  };
  const showValues = (rows) => { values = rows; showReadout(); };
  const showPlacing = (what) => { placing = what; showReadout(); };

  // ---------------------------------------------------------------------------------------- where the pointer is
  let canvas = null;
  const area = (one) => one.clientWidth * one.clientHeight;
  const fit = () => {
    canvas = [...document.querySelectorAll("canvas")].reduce((a, b) => (a && area(a) >= area(b) ? a : b), null);
    const box = canvas ? canvas.getBoundingClientRect() : { left: 0, top: 0, width: 0, height: 0 };
    const bottom = Math.min(box.top + box.height, fitSheet());
    Object.assign(root.style, { left: `${box.left}px`, top: `${box.top}px`, width: `${box.width}px`,
      height: `${bottom - box.top}px` });
  };
  // On a phone viser's panel is a sheet at the bottom, open over more than half of the scene. It begins folded, and what
  // is shown here stays above it. Returns its upper edge, in pixels.
  const fitSheet = () => {
    const sheet = [...document.querySelectorAll('[style*="max-height"]')].find(({ style }) =>
      style.position === "fixed" && style.bottom === "0px");
    const handle = sheet?.querySelector('[style*="cursor: pointer"]');
    if (!handle) return Infinity;
    if (!sheet.dataset.mbfSheet) {
      sheet.dataset.mbfSheet = "folded";
      Object.assign(sheet.style, { width: "100%", maxHeight: "50%" });
      handle.parentElement.style.width = "100vw";
      const sign = element(handle, "span", "margin-left:auto;font:13px system-ui,sans-serif;color:#1f6feb;");
      new ResizeObserver(() => {
        sign.textContent = sheet.offsetHeight > 2 * handle.offsetHeight ? "Hide controls" : "Controls";
      }).observe(sheet);
      handle.click();
    }
    return sheet.getBoundingClientRect().top;
  };
  const isOnScene = ({ target }) => // viser lays a second canvas over that of the scene
    canvas !== null && ((target.tagName === "CANVAS" && area(target) === area(canvas)) || target.contains?.(canvas));
  const placeOf = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const within = ([u, v]) => [Math.min(Math.max(u, 0), 1), Math.min(Math.max(v, 0), 1)];
  let pointer = null, reported = "null";
  const reportPointer = () => {
    const now = JSON.stringify(pointer);
    if (now !== reported) send({ point: pointer });
    reported = now;
  };

  // ---------------------------------------------------------------------------------------- a goal by drag
  let steers = false, drag = null, places = false;
  const swallow = (event) => { event.stopImmediatePropagation(); event.preventDefault(); };
  const drawArrow = () => {
    const box = root.getBoundingClientRect();
    const [x0, y0] = [drag.x0 - box.left, drag.y0 - box.top], [dx, dy] = [drag.x - drag.x0, drag.y - drag.y0];
    const length = Math.hypot(dx, dy) || 1, [ux, uy] = [dx / length, dy / length], [x1, y1] = [x0 + dx, y0 + dy];
    const barb = (side) => `M${x1} ${y1}l${-14 * ux + side * 8 * uy} ${-14 * uy - side * 8 * ux}`;
    const circle = `M${x0 - 5} ${y0}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0`;
    arrow.setAttribute("d", length < LEAST_DRAG ? circle : `${circle}M${x0} ${y0}L${x1} ${y1}${barb(1)}${barb(-1)}`);
  };
  const endDrag = () => { drag = null; arrow.setAttribute("d", ""); };
  listen(window, "pointerdown", (event) => {
    if (!steers || event.button !== 0 || !isOnScene(event) || !(event.shiftKey || places)) return;
    swallow(event);
    drag = { start: placeOf(event), x0: event.clientX, y0: event.clientY, x: event.clientX, y: event.clientY,
             pointer: event.pointerId };
    drawArrow();
  });
  listen(window, "pointermove", (event) => {
    pointer = isOnScene(event) ? within(placeOf(event)) : null;
    if (!drag || event.pointerId !== drag.pointer) return;
    swallow(event);
    Object.assign(drag, { x: event.clientX, y: event.clientY });
    drawArrow();
  });
  listen(window, "pointerup", (event) => {
    if (!drag || event.pointerId !== drag.pointer) return;
    swallow(event);
    const short = Math.hypot(event.clientX - drag.x0, event.clientY - drag.y0) < LEAST_DRAG;
    send({ goal: [drag.start, short ? drag.start : within(placeOf(event))] });
    endDrag();
  });
  listen(window, "pointercancel", () => endDrag());
  listen(document, "mouseleave", () => { pointer = null; });

  // ---------------------------------------------------------------------------------------- the stick, a deadman's switch
  // It is held while the pointer is down on its field, or while the space bar is down; letting go in any way stops.
  const held = new Set();
  // Each report carries the newest heartbeat of the server, so that one that comes late is known by its age. One that
  // could not be sent at once is left out: the next one is newer.
  let beat = null;
  const reportStick = () => { if (beat !== null && socket.bufferedAmount === 0) send({ stick: [...stick, beat] }); };
  let stick = null, pad = null, knob = null, status = null;
  const field = (event) => {
    const box = pad.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * 2 - 1, y = (event.clientY - box.top) / box.height * 2 - 1;
    const scale = Math.max(1, Math.hypot(x, y));
    return [-x / scale, -y / scale];
  };
  const ofKeys = () => {
    let turn = 0, forward = 0;
    for (const code of held) { turn += (KEYS[code] || [0, 0])[0]; forward += (KEYS[code] || [0, 0])[1]; }
    return [Math.sign(turn), Math.sign(forward)];
  };
  const hold = (position) => {
    const before = stick;
    stick = position;
    if (stick) reportStick();
    else if (before) { send({ stick: null }); showStatus(""); }
    const [turn, forward] = stick || [0, 0];
    knob.style.transform = `translate(${-turn * PAD * 0.7}px, ${-forward * PAD * 0.7}px)`;
    knob.style.background = stick ? "#1f6feb" : "#8a8f98";
  };
  const showStatus = (text) => { if (status) status.textContent = stick ? text || "taking over" : howToHold; };
  const howToHold = matchMedia("(pointer: coarse)").matches ? "Hold to drive" : "Hold to drive, or space + WASD";
  const letGo = () => { held.clear(); if (stick) hold(null); };
  const addStick = () => {
    const card = element(root, "div", "position:absolute;right:10px;bottom:10px;padding:6px;width:130px;" +
      "text-align:center;" + CARD);
    pad = element(card, "div", `width:${2 * PAD}px;height:${2 * PAD}px;margin:0 auto 4px;border-radius:50%;` +
      "background:#eaeef2;touch-action:none;cursor:grab;display:flex;align-items:center;justify-content:center;");
    pad.id = "mbf-stick";
    pad.title = "Hold and move to drive; releasing stops the robot. Keys: hold the space bar, steer with WASD or arrows";
    knob = element(pad, "div", "width:36px;height:36px;border-radius:50%;background:#8a8f98;");
    status = element(card, "div", "font-size:11px;line-height:1.3;min-height:2.6em;");
    showStatus("");
    listen(pad, "pointerdown", (event) => {
      swallow(event);
      if (event.button !== 0) { letGo(); return; }
      pad.setPointerCapture(event.pointerId);
      hold(field(event));
    });
    listen(pad, "pointermove", (event) => { if (stick && event.buttons) hold(field(event)); });
    listen(window, "contextmenu", letGo); // a menu takes the pointer; its release may never come
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) listen(pad, end, letGo);
    listen(window, "keydown", (event) => {
      if (event.target.closest?.("input,textarea,select,[contenteditable]")) return;
      if (event.metaKey || event.ctrlKey || event.altKey) { letGo(); return; } // then releases of keys may never come
      if (event.code !== "Space" && !(held.has("Space") && event.code in KEYS)) return;
      swallow(event);
      if (event.repeat) return; // still down, perhaps since before the stick was let go
      held.add(event.code);
      hold(ofKeys());
    });
    listen(window, "keyup", (event) => {
      if (!held.delete(event.code)) return;
      swallow(event);
      if (event.code === "Space") letGo(); else hold(ofKeys());
    });
    for (const [target, type] of [[window, "blur"], [window, "pagehide"], [document, "visibilitychange"]])
      listen(target, type, letGo);
  };

  // ---------------------------------------------------------------------------------------- life
  const steer = () => {
    steers = true;
    element(bar, "span", "width:1px;margin:2px 4px;background:#d0d7de;");
    press(button("Place", "A drag without Shift places a goal, too; for touch screens", (made) => {
      places = !places;
      press(made, places);
    }), false);
    addStick();
  };
  const watch = () => element(bar, "span", "padding:3px 9px;color:#57606a;", { textContent: "Watching only",
    title: "The panel shows what those choose who steer; its buttons do nothing here" });
  const takeBeat = (time) => { beat = time; if (stick) reportStick(); };
  const shown = { beat: takeBeat, values: showValues, placing: showPlacing, tree: showTree, stick: showStatus,
    role: (role) => { if (role === "steer") { if (!steers) steer(); } else watch(); } };
  socket.onmessage = (event) => {
    for (const [kind, content] of Object.entries(JSON.parse(event.data))) shown[kind]?.(content);
  };
  socket.onclose = ({ code }) => {
    steers = false;
    notice.textContent = code === GOING_AWAY ? "The run has ended" : "Connection lost: reload the page";
    notice.style.display = "block";
    if (status) status.textContent = notice.textContent;
  };
  const timer = setInterval(() => { fit(); reportPointer(); }, SEND_EVERY);
  listen(window, "keydown", (event) => { if (event.code === "Escape" && drag) { swallow(event); endDrag(); } });
  fit();
  window.mbfVisitor = { close: () => { if (stick) letGo(); listening.abort(); clearInterval(timer); socket.close(); root.remove(); } };
}
