// What the ground is coloured by: its slopes, or the costs of one of the map's layers, with a legend of that.
class Colours {
  constructor(world, scene, changed) {
    this.world = world;
    this.changed = changed;
    this.choice = document.getElementById('colours');
    this.legend = document.getElementById('cost-legend');
    this.choice.hidden = !world.layers.length;
    ['slopes', ...world.layers.map(({name}) => 'costs: ' + name)].forEach((text, k) => this.choice.add(new Option(text, k)));
    this.choice.addEventListener('change', () => this.show(Number(this.choice.value)));
    const css = colour => `rgb(${colour.map(value => Math.round(255 * value))})`;
    this.ramp = `linear-gradient(90deg, ${scene.slopes.map(css)})`;
    this.closed = [[css(scene.layers.forbidden), 'forbidden'], [css(scene.layers.nowhere), 'not on the map']];
  }

  // Layer number - 1; 0 = slopes.
  show(number) {
    const layer = this.world.layers[number - 1];
    this.choice.value = number;
    this.world.colourBy(layer);
    this.legend.hidden = !layer;
    if (layer) this.showLegend(layer);
    this.changed();
  }

  showLegend({name, range}) {
    const title = document.createElement('b');
    title.textContent = name;
    const entries = [[this.ramp, range], ...this.closed].map(([look, text]) => {
      const entry = document.createElement('span'), sample = document.createElement('i');
      sample.style.background = look;
      entry.append(sample, text);
      return entry;
    });
    this.legend.replaceChildren(title, ...entries);
  }

  next() { if (this.world.layers.length) this.show((Number(this.choice.value) + 1) % (this.world.layers.length + 1)); }
}
