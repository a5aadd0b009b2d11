// Time: the bar, its buttons, and the keys.
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const LONGEST = 60;  // s that a run takes at the speed it begins with
const KEYS = [['space', 'play, pause'], ['← →', '1 s back, ahead; with shift 10 s'], ['home end', 'begin, end'],
  ['N P', 'next, previous incident'], ['1 2 3', 'overview, follow, above'], ['[ ]', 'storeys shown'],
  ['R', 'next robot'], ['C', 'colours of the ground'], ['+ −', 'speed'], ['I', 'panel'], ['?', 'this list'],
  ['drag', 'turn; right button or two fingers: shift'], ['wheel, pinch', 'zoom']];

class Player {
  // It plays at once, but not for those who want no motion, nor in a page around it that could not be read meanwhile.
  constructor(run, onChange, software) {
    this.run = run;
    this.onChange = onChange;
    this.bar = document.getElementById('time');
    this.end = Number(this.bar.max);
    this.time = 0;
    this.speeds = document.getElementById('speed');
    for (const speed of SPEEDS) this.speeds.add(new Option(speed + ' ×', speed));
    this.speeds.value = SPEEDS.find(speed => speed >= 1 && this.end / speed <= LONGEST) || SPEEDS[SPEEDS.length - 1];
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches || (software && window.self !== window.top);
    this.playing = this.end > 0 && !calm;
    this.bar.addEventListener('input', () => this.seek(Number(this.bar.value)));
    document.getElementById('play').addEventListener('click', () => this.toggle());
    this.show();
  }

  toggle() {
    if (!this.playing && this.time >= this.end) this.time = 0;
    this.playing = !this.playing;
    this.show();
  }

  seek(time) { this.time = clamped(time, 0, this.end); this.jumped = true; this.show(); }
  jump(at) { this.seek(at - this.run.lead); }

  // To the next incident after now, or the last one before.
  step(direction) {
    const times = this.run.incidents.map(incident => Math.max(incident[0] - this.run.lead, 0));
    const next = direction > 0 ? times.find(at => at > this.time + 0.05) : times.reverse().find(at => at < this.time - 0.5);
    if (next !== undefined) this.seek(next);
  }

  faster(direction) {
    this.speeds.selectedIndex = clamped(this.speeds.selectedIndex + direction, 0, SPEEDS.length - 1);
  }

  advance(seconds) {
    if (!this.playing) return;
    this.time = Math.min(this.end, this.time + seconds * Number(this.speeds.value));
    if (this.time >= this.end) this.playing = false;
    this.show();
  }

  show() {
    this.bar.value = this.time;
    document.getElementById('clock').value = `${this.time.toFixed(1)} / ${this.end.toFixed(1)} s`;
    document.getElementById('play').textContent = this.playing ? '❚❚' : '▶';
    this.onChange();
  }
}

function showKeys() {
  const place = document.getElementById('keys'), list = document.createElement('dl');
  for (const [key, meaning] of KEYS)
    for (const [tag, text] of [['dt', key], ['dd', meaning]]) {
      const item = document.createElement(tag);
      item.textContent = text;
      list.append(item);
    }
  place.replaceChildren(list);
  place.hidden = !place.hidden;
}
