// Names of start, goals and robots: chips of one size on the screen, with a stick that ends where they belong.
const STICK = 16;  // pixels; longer where another chip would be covered
const GAP = 2;  // pixels between two chips, or a chip and a robot

class Labels {
  constructor(place, marks, robots) {
    this.place = place;
    this.robots = robots;
    this.pins = [...marks.map(mark => ({...mark, at: () => mark.position})),
      ...(robots.length > 1 ? robots : []).map(robot => ({name: robot.name, colour: robot.ring, at: () => robot.at && plus(robot.at,
        [0, 0, robot.height * robot.scale])}))].map(pin => ({...pin, ...this.chip(pin)}));
  }

  chip({name, colour}) {
    const element = document.createElement('div'), text = document.createElement('b'), stick = document.createElement('i');
    element.className = 'pin';
    text.textContent = name;
    text.style.background = stick.style.background = `rgb(${colour})`;
    element.append(text, stick);
    this.place.append(element);
    return {element, stick, wide: text.offsetWidth, tall: text.offsetHeight};
  }

  show(camera, cut) {
    const shown = this.robots.filter(robot => robot.at).map(robot => boxOf(robot, camera)).filter(box => box);
    for (const pin of this.pins) {
      const at = pin.at(), place = at && camera.project(at);
      pin.element.hidden = !place;
      if (!place) continue;
      const raised = this.raised(pin, place, shown);
      pin.stick.style.height = raised + 'px';
      pin.element.style.transform = `translate(${Math.round(place[0])}px, ${Math.round(place[1])}px) translate(-50%, -100%)`;
      pin.element.style.opacity = at[2] > cut ? 0.45 : 1;
      shown.push({x: place[0], y: place[1] - raised, wide: pin.wide, tall: pin.tall});
    }
  }

  // Length of the stick with which a chip covers neither a robot nor a chip that is shown.
  raised(pin, [x, y], shown) {
    let length = STICK;
    const covered = () => shown.find(other => Math.abs(other.x - x) < 0.5 * (other.wide + pin.wide) + GAP &&
      y - length > other.y - other.tall - GAP && y - length - pin.tall - GAP < other.y);
    for (let other = covered(); other; other = covered()) length = Math.ceil(y - other.y + other.tall + GAP) + 1;
    return length;
  }
}

// What of the window a robot covers: middle of its lower side, width, height in pixels; null where it is behind the eye.
function boxOf(robot, camera) {
  const foot = camera.project(robot.at), top = camera.project(plus(robot.at, [0, 0, robot.height * robot.scale]));
  return foot && top && {x: foot[0], y: foot[1], wide: robot.reach * robot.scale * camera.pixelsPerMetre(robot.at),
    tall: Math.max(0, foot[1] - top[1])};
}
