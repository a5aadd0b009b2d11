// Names of start, goals and robots: chips of one size on the screen, with a stick that ends where they belong.
class Labels {
  constructor(place, marks, robots) {
    this.place = place;
    this.pins = [...marks.map(mark => ({...mark, at: () => mark.position})),
      ...(robots.length > 1 ? robots : []).map(robot => ({name: robot.name, colour: robot.ring, at: () => robot.at && plus(robot.at,
        [0, 0, robot.height * robot.scale])}))].map(pin => ({...pin, element: this.chip(pin)}));
  }

  chip({name, colour}) {
    const pin = document.createElement('div'), text = document.createElement('b'), stick = document.createElement('i');
    pin.className = 'pin';
    text.textContent = name;
    text.style.background = stick.style.background = `rgb(${colour})`;
    pin.append(text, stick);
    this.place.append(pin);
    return pin;
  }

  show(camera, cut) {
    for (const pin of this.pins) {
      const at = pin.at(), place = at && camera.project(at);
      pin.element.hidden = !place;
      if (!place) continue;
      pin.element.style.transform = `translate(${Math.round(place[0])}px, ${Math.round(place[1])}px) translate(-50%, -100%)`;
      pin.element.style.opacity = at[2] > cut ? 0.45 : 1;
    }
  }
}
