// Pointers, wheel and keys on a picture. `actions` are { isReady, start, turn, move, pan }: whether there is something to turn,
// what happens before each, and the three of orbits.js.

import { clamp } from './vectors.js';

const TURN = Math.PI * 0.75; // radians for the width of the picture
const STEP = Math.PI / 60;   // radians for a key
// What takes these keys itself: check boxes take none of them, radio buttons the arrows.
const TAKES_KEYS = 'input:not([type="checkbox"], [type="radio"]), select, textarea';
const TAKES_ARROWS = 'input:not([type="checkbox"]), select, textarea';

export function listenToHands(canvas, actions) {
  const hands = new Map();   // pointers that are down
  const middle = () => {
    const all = [...hands.values()];
    const centre = [0, 1].map((i) => all.reduce((sum, own) => sum + own[i], 0) / all.length);
    const spread = all.length > 1 ? Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]) : 0;
    return { centre, spread };
  };
  canvas.addEventListener('pointerdown', (event) => {
    if (!actions.isReady()) return;
    actions.start();
    canvas.focus({ preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.classList.add('held');
    event.preventDefault();
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!hands.has(event.pointerId)) return;
    const before = middle();
    hands.set(event.pointerId, [event.clientX, event.clientY]);
    const after = middle();
    const [across, below] = [0, 1].map((i) => (after.centre[i] - before.centre[i]) / canvas.clientWidth);
    if (hands.size > 1) {
      if (before.spread > 0 && after.spread > 0) actions.move(before.spread / after.spread);
      actions.pan(across, below);
    } else if (event.shiftKey || event.buttons === 4) {
      actions.pan(across, below);
    } else {
      actions.turn(-across * TURN, below * TURN);
    }
  });
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (event) => {
      hands.delete(event.pointerId);
      if (hands.size === 0) canvas.classList.remove('held');
    });
  }
  canvas.addEventListener('wheel', (event) => {
    if (!actions.isReady()) return;
    event.preventDefault();
    actions.start();
    const lines = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
    actions.move(Math.exp(clamp(lines, -200, 200) / 600));
  }, { passive: false });
}

// `back` goes to the start.
export function listenToKeys(actions, back) {
  const keys = {
    ArrowLeft: () => actions.turn(-STEP, 0),
    ArrowRight: () => actions.turn(STEP, 0),
    ArrowUp: () => actions.turn(0, STEP),
    ArrowDown: () => actions.turn(0, -STEP),
    '+': () => actions.move(0.95),
    '=': () => actions.move(0.95),
    '-': () => actions.move(1 / 0.95),
    0: back,
  };
  document.addEventListener('keydown', (event) => {
    const takes = event.key.startsWith('Arrow') ? TAKES_ARROWS : TAKES_KEYS;
    const isTyping = event.target instanceof Element && event.target.matches(takes);
    const action = keys[event.key];
    if (!actions.isReady() || isTyping || !action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    actions.start();
    action();
  });
}
