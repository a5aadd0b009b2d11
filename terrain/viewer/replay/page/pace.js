// How sharp a moving picture is, and how often it is drawn: less while frames take long, as without a graphics card.
// A picture that stands is always sharp.
const LONG_FRAME = 50, SHORT_FRAME = 25;  // ms
const COARSEST = 0.4, COARSER = 0.8;
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

class Pace {
  constructor(gl) {
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    this.software = SOFTWARE.test(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    this.sharpness = this.software ? COARSEST : 1;  // pixels of a moving picture by those of one that stands, along a side
    this.frame = 0;   // ms that a frame took, a moving mean
    this.ready = 0;   // when the next frame may be drawn: a page that draws slowly has half of the time for its user
  }

  // Note that the frame begun at a time took until now, on the processor and in waiting for the picture before.
  note(begun, now) {
    const took = now - begun;
    this.frame = this.frame ? 0.7 * this.frame + 0.3 * took : took;
    if (this.frame > LONG_FRAME) {
      this.ready = now + Math.min(took, 500);
      if (this.sharpness > COARSEST) this.become(Math.max(COARSEST, COARSER * this.sharpness));
    } else if (this.frame < SHORT_FRAME && this.sharpness < 1) this.become(Math.min(1, this.sharpness / COARSER));
  }

  become(sharpness) { this.sharpness = sharpness; this.frame = 0; }
}
