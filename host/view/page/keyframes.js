// The keyframes of a camera path: added, removed, played, saved.

import { commandOf } from './elsewhere.js';
import { nameOf, said, saveJson, transforms } from './files.js';
import { RATE, poseAt, posesOf } from './path.js';
import { element, state } from './state.js';
import { clamp } from './vectors.js';

const MAX_FRAMES = 2000;

let playing = 0;             // the animation frame that is due; 0 while nothing is played

export const frames = () => clamp(Math.round(Number(element('frames').value)) || 0, 2, MAX_FRAMES);

function button(text, title, action) {
  const own = document.createElement('button');
  own.type = 'button';
  own.textContent = text;
  own.title = title;
  own.setAttribute('aria-label', title);
  own.addEventListener('click', action);
  return own;
}

// `go` takes the view to a pose and what it turns around.
function showKeyframes(go) {
  element('keyframes').replaceChildren(...state.keyframes.map((own, i) => {
    const item = document.createElement('li');
    const remove = () => {
      state.keyframes.splice(i, 1);
      showKeyframes(go);
    };
    item.append(button(`${i + 1}`, `Go to keyframe ${i + 1}`, () => { stop(); go(own.pose, own.focus); }),
      button('×', `Remove keyframe ${i + 1}`, remove));
    return item;
  }));
  const isPath = state.keyframes.length > 1;
  for (const id of ['play', 'save-path', 'save-video']) element(id).disabled = !isPath;
  element('path-hint').hidden = isPath;
  tellPath();
}

export function tellPath() {
  element('duration').textContent = `${(frames() / RATE).toFixed(1)} s`;
  const isShown = state.keyframes.length > 1 && state.scene.commands.render !== '';
  element('path-command').hidden = !isShown;
  if (isShown) element('path-command').textContent = `${commandOf(`--camera-path ${fileOfPath()}`)} --video webp`;
}

// By what decides its frames.
const fileOfPath = () => nameOf('path', '.json', [state.keyframes, frames()]);

// Ends what is played.
export function stop() {
  cancelAnimationFrame(playing);
  playing = 0;
  element('play').textContent = 'Play';
}

function play(go) {
  if (playing !== 0) {
    stop();
    return;
  }
  const start = performance.now();
  const time = 1000 * frames() / RATE;
  const next = () => {
    const share = Math.min(1, (performance.now() - start) / time);
    go(poseAt(state.keyframes, share), state.keyframes[Math.round(share * (state.keyframes.length - 1))].focus);
    if (share < 1) playing = requestAnimationFrame(next); else stop();
  };
  element('play').textContent = 'Stop';
  playing = requestAnimationFrame(next);
}

function save() {
  const width = String(frames()).length;
  const named = posesOf(state.keyframes, frames()).map((pose, i) => [`view_${String(i).padStart(width, '0')}`, pose]);
  saveJson(fileOfPath(), transforms(named, { fps: RATE }));
  said(`Saved as ${fileOfPath()}: ${named.length} frames.`);
}

export function listenToKeyframes(go) {
  element('add-keyframe').addEventListener('click', () => {
    state.keyframes.push({ pose: state.pose, focus: state.focus });
    showKeyframes(go);
  });
  element('play').addEventListener('click', () => play(go));
  element('save-path').addEventListener('click', save);
  element('frames').addEventListener('input', tellPath);
  showKeyframes(go);
}
