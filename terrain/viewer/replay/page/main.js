// Puts the parts together; window.replay is for tests and for pages around this one.
const STORE = id => JSON.parse(document.getElementById(id).textContent);
const CUT_SHARE = 0.7, CUT_HEIGHT = 2.0;  // above the robot's floor: of a storey's height, at most [m]
const ALL = 1e9;
const SETTLED = 150;  // ms without motion until a picture is drawn sharp
const MOST_STEP = 1;  // s of a run's time that passes at most from a frame to the next, before its speed
const LEAST_TILT = 1000;  // thousandths of a degree; a robot that never tilts as much has nothing to say about it

class Replay {
  constructor(scene, run, arrays) {
    this.scene = scene;
    this.canvas = document.querySelector('canvas');
    this.drawing = new Drawing(this.canvas);
    this.pace = new Pace(this.drawing.gl);
    this.dirty = true;
    this.coarse = false;  // whether the picture that is shown is one of a moving scene
    this.seen = true;
    const changed = () => { this.dirty = true; };
    this.player = new Player(run, changed, this.pace.software);
    this.panel = new Panel(run, at => this.player.jump(at));
    this.world = new World(this.drawing, scene, arrays, this.pace.software);
    this.bodies = new Bodies(this.drawing, scene, arrays);
    this.lines = new Lines(this.drawing, scene, arrays, this.bodies.times);
    this.labels = new Labels(document.getElementById('labels'), scene.marks, this.bodies.robots);
    this.camera = new Camera(this.canvas, scene, this.bodies, changed);
    this.sky = this.drawing.program(SKY_VERTEX, SKY_FRAGMENT);
    this.empty = this.drawing.gl.createVertexArray();
    this.chosen = 0;
    this.storey = 'robot';
    this.addControls();
    this.last = performance.now();
    requestAnimationFrame(now => this.tick(now));
  }

  get robot() { return this.bodies.robots[this.chosen]; }

  addControls() {
    document.querySelectorAll('#views button').forEach(button =>
      button.addEventListener('click', () => { this.camera.show(button.dataset.view); button.blur(); }));
    const storeys = document.getElementById('storeys'), robots = document.getElementById('robots');
    storeys.hidden = !this.scene.storeys.length;
    storeys.add(new Option("robot's storey", 'robot'));
    this.scene.storeys.forEach((height, k) => storeys.add(new Option('storey ' + k, k)));
    storeys.add(new Option('all storeys', 'all'));
    storeys.addEventListener('change', () => this.showStorey(storeys.value));
    this.colours = new Colours(this.world, this.scene, () => { this.dirty = true; });
    robots.hidden = this.bodies.robots.length < 2;
    this.bodies.robots.forEach((robot, k) => robots.add(new Option(robot.name, k)));
    robots.addEventListener('change', () => { this.chosen = Number(robots.value); this.dirty = true; });
    document.getElementById('help').addEventListener('click', showKeys);
    document.getElementById('panel-button').addEventListener('click', () => this.togglePanel());
    if (matchMedia('(max-width: 720px), (max-height: 420px)').matches || window.self !== window.top) this.togglePanel();
    document.addEventListener('keydown', event => this.key(event));
    new IntersectionObserver(entries => { this.seen = entries[entries.length - 1].isIntersecting; }).observe(this.canvas);
    new ResizeObserver(() => this.resized()).observe(this.canvas);
  }

  // An observer calls at its beginning, too, when this size has been drawn.
  resized() {
    const size = [this.canvas.clientWidth, this.canvas.clientHeight].join();
    if (this.shown === size) return;
    if (!this.camera.touched) this.fit();
    this.dirty = true;
  }

  fit() { if (this.camera.view !== 'follow') { this.camera.show(this.camera.view); this.camera.blend = 0; } }

  showStorey(which) {
    this.storey = which;
    document.getElementById('storeys').value = which;
    this.dirty = true;
  }

  togglePanel() {
    const closed = document.getElementById('panel').classList.toggle('closed');
    document.getElementById('panel-button').setAttribute('aria-expanded', String(!closed));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'SELECT') return;
    if (event.key === ' ' && ['BUTTON', 'SUMMARY'].includes(event.target.tagName)) return;  // it is pressed
    const {player} = this, far = event.shiftKey ? 10 : 1;
    const actions = {
      ' ': () => player.toggle(), ArrowLeft: () => player.seek(player.time - far), ArrowRight: () => player.seek(player.time + far),
      Home: () => player.seek(0), End: () => player.seek(player.end), n: () => player.step(1), p: () => player.step(-1),
      1: () => this.camera.show('overview'), 2: () => this.camera.show('follow'), 3: () => this.camera.show('above'),
      '[': () => this.nextStorey(-1), ']': () => this.nextStorey(1), r: () => this.nextRobot(),
      c: () => this.colours.next(),
      '+': () => player.faster(1), '-': () => player.faster(-1), i: () => this.togglePanel(), '?': showKeys,
      Escape: () => { document.getElementById('keys').hidden = true; },
    };
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
    this.dirty = true;
  }

  nextStorey(direction) {
    const choices = ['robot', ...this.scene.storeys.keys(), 'all'].map(String);
    if (this.scene.storeys.length) this.showStorey(choices[clamped(choices.indexOf(this.storey) + direction, 0, choices.length - 1)]);
  }

  nextRobot() {
    this.chosen = (this.chosen + 1) % this.bodies.robots.length;
    document.getElementById('robots').value = this.chosen;
  }

  // Height [m] above which nothing is drawn, so that a roof does not hide the robot.
  cut() {
    const floors = this.scene.storeys;
    if (!floors.length || this.storey === 'all') return ALL;
    if (this.storey === 'robot') {
      const storey = Math.min(...floors.slice(1).map((floor, k) => floor - floors[k]));
      return (this.robot && this.robot.at ? this.robot.at[2] : floors[0]) + Math.min(CUT_SHARE * storey, CUT_HEIGHT);
    }
    const at = Number(this.storey), above = floors[at + 1];
    return above === undefined ? ALL : floors[at] + Math.min(CUT_SHARE * (above - floors[at]), CUT_HEIGHT);
  }

  // Nothing moves, and nothing is drawn, while the page's part of a window is not seen.
  tick(now) {
    const seconds = clamped((now - this.last) / 1000, 0, MOST_STEP), {pace} = this;
    if (this.begun) pace.note(this.begun, now);
    this.begun = 0;  // a frame of a moving scene
    requestAnimationFrame(next => this.tick(next));
    if (!this.canvas.clientWidth || document.hidden || !this.seen) this.last = now;
    else if (now >= pace.ready) {
      this.last = now;
      this.player.advance(seconds);
      if (this.dirty) {
        this.moved = now;
        this.begun = this.used ? now : 0;
        this.draw(seconds, this.used ? pace.sharpness : 1);
      } else if (this.coarse && now > this.moved + SETTLED) this.draw(seconds, 1);
    }
  }

  draw(seconds, sharpness) {
    const {drawing, camera, bodies, world, player} = this, gl = drawing.gl;
    const ratio = Math.min(devicePixelRatio || 1, 2) * sharpness;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map(side => Math.round(side * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, {width, height});
    this.shown = [this.canvas.clientWidth, this.canvas.clientHeight].join();
    this.coarse = sharpness < 1;
    drawing.begin();
    bodies.place(player.time, camera, this.robot);
    if (this.robot) camera.follow(this.robot, player.jumped ? Infinity : seconds * Number(player.speeds.value));
    player.jumped = false;
    this.dirty = camera.advance(seconds);
    const cut = this.cut(), view = camera.matrices(), level = world.level(camera.eye, camera.focal * ratio);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.BLEND);
    world.drawShadows(cut);
    gl.viewport(0, 0, width, height);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const common = {view, cut, eye: camera.eye, light: this.scene.light, toLight: world.toLight, shadows: 0,
      window: [width, height], ratio};
    world.draw(common, level);
    this.drawSky(width / height);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    bodies.drawHidden(common);
    bodies.draw(common, this.marks());
    this.lines.draw(common, player.time, camera);
    this.labels.show(camera, cut);
    this.showText();
    this.used = {drawCalls: drawing.calls, triangles: drawing.triangles, bytes: drawing.bytes,
      level: world.levels.indexOf(level), cut};
  }

  drawSky(aspect) {
    const {drawing, camera} = this, tall = Math.tan(camera.fov / 2);
    drawing.use(this.sky, {ahead: camera.ahead, right: camera.right.map(value => value * tall * aspect),
      top: camera.top.map(value => value * tall)});
    drawing.gl.bindVertexArray(this.empty);
    drawing.corners(3);
  }

  // Rings on the ground at start and goals.
  marks() {
    return this.scene.marks.map(({position, colour}) =>
      [plus(position, [0, 0, 0.05]), [this.scene.ring, 0, 0], [0, this.scene.ring, 0], [...colour, 255], 1]);
  }

  showText() {
    const {player, camera} = this, robot = this.robot, last = player.end > 0 && player.time >= player.end;
    const text = [];
    if (robot && robot.at) {
      const speed = robot.speeds[this.bodies.frame] / 1000, tilt = robot.tilts[this.bodies.frame] / 1000;
      if (robot.name) text.push(robot.name);
      text.push(`${speed.toFixed(1)} m/s`);
      if (robot.tilted) text.push(`tilt ${tilt.toFixed(0)}°`);
      if (robot.scale > 1.05) text.push(`robot drawn ${robot.scale.toFixed(1)} × its size`);
      if (last) text.push(this.scene.ending);
    }
    document.getElementById('status').textContent = text.join(' · ');
    document.querySelectorAll('#views button').forEach(button =>
      button.setAttribute('aria-pressed', String(button.dataset.view === camera.view)));
    this.panel.show(Math.round(10 * player.time) / 10);
  }
}

async function begin() {
  const scene = STORE('scene-data'), run = STORE('run-data');
  const arrays = await unpacked(scene.arrays, document.getElementById('scene-arrays').textContent.trim());
  for (const robot of scene.robots) {
    robot.speeds = arrays[robot.speeds];
    robot.tilts = arrays[robot.tilts];
    robot.tilted = robot.tilts.some(tilt => tilt >= LEAST_TILT);
  }
  window.replay = new Replay(scene, run, arrays);
}

begin().catch(error => {
  document.getElementById('status').textContent = String(error.message || error);
  console.error(error);
});
