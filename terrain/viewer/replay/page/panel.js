// The text beside the scene: what happened until now, the behaviour tree, incidents to jump to.
class Panel {
  constructor(run, onJump) {
    this.run = run;
    this.addJumps(onJump);
  }

  show(time) {
    if (time === this.time) return;
    this.time = time;
    this.showLines(time);
    if (this.run.trees.length) this.showTree(time);
  }

  showLines(time) {
    const shown = [];  // the newest first; of the same that happens again and again the newest, with how often it has
    const past = this.run.lines.filter(line => line[0] <= time).reverse();
    for (const [at, text, colour] of past) {
      const same = text.split(':')[0], before = shown[shown.length - 1];
      if (before && before.same === same) before.times += 1;
      else if (shown.length === this.run.shown) break;
      else shown.push({at, text, colour, same, times: 1});
    }
    document.getElementById('run-lines').replaceChildren(...shown.map(({at, text, colour, times}) =>
      lineOf(`${at.toFixed(1)} s  ${text}${times > 1 ? `  (${times} times)` : ''}`, 'color:' + colour)));
  }

  showTree(time) {
    const {trees, symbols, indent, colours} = this.run;
    const begun = trees.filter(tree => tree.time <= time), tree = begun[begun.length - 1];
    const place = document.getElementById('run-tree');
    place.replaceChildren();
    if (!tree) return;
    const now = tree.nodes.map(() => ['INVALID', '']);
    for (const [at, index, status, message] of tree.changes) { if (at > time) break; now[index] = [status, message]; }
    const branch = [];
    tree.nodes.forEach(([name, depth], index) => {
      const [status, message] = now[index];
      branch[depth] = status;
      if (status === 'INVALID' && depth > 0 && branch[depth - 1] !== 'RUNNING') return;
      const failed = status === 'FAILURE' && message ? '  ' + message : '';
      place.append(lineOf(symbols[status] + ' ' + name + failed, 'padding-left:' + depth * indent + 'px;color:' +
        colours[status] + (status === 'RUNNING' ? ';font-weight:600' : '')));
    });
  }

  addJumps(onJump) {
    const end = Number(document.getElementById('time').max) || 1;
    this.run.incidents.forEach(([at, text, colour, symbol]) => {
      const words = at.toFixed(1) + ' s  ' + text;
      for (const [place, label] of [['run-marks', symbol], ['run-incidents', symbol + ' ' + words]]) {
        const button = document.createElement('button');
        button.textContent = label; button.title = words; button.style.color = colour;
        if (place === 'run-marks') button.style.left = 100 * at / end + '%';
        button.addEventListener('click', () => { onJump(at); button.blur(); });
        document.getElementById(place).append(button);
      }
    });
  }
}

// A number and its unit stay on one line.
function lineOf(text, style) {
  const line = document.createElement('div');
  line.textContent = text.replace(/(\d) (?=[a-z°%])/g, '$1\u00a0'); line.style.cssText = style;
  return line;
}
