// The page of `viewfuse view`: the novel view's camera follows the hand; pictures and weights come from the program.
//
//   vectors, poses     cameras in the world
//   colours, canvas    what is drawn with
//   state              what the page shows
//   frusta, picture, map, sources, schemes, answers
//                      parts of the page
//   rotations, path    the way between keyframes
//   files, elsewhere, keyframes
//                      what is saved and copied
//   requests, video    what the program is asked
//   hand, work, view   what a person does, what the program does, and the beginning
//
// A module imports from those above it only.

import { drawScale } from './colours.js';
import { copy, savePicture, savePose } from './elsewhere.js';
import { back, goTo, listenToKeyboard, listenToMap, listenToPicture } from './hand.js';
import { listenToKeyframes, stop } from './keyframes.js';
import { drawMap, firstObserver } from './map.js';
import { drawPicture } from './picture.js';
import { poseOf } from './poses.js';
import { changed, told } from './requests.js';
import { chooseScheme, schemeText, showSchemes } from './schemes.js';
import { showPhotographs, showSources } from './sources.js';
import { element, state } from './state.js';
import { clamp, length, sub } from './vectors.js';
import { listenToVideo } from './video.js';
import { watch } from './work.js';

function schemeChanged() {
  state.scheme = schemeText();
  state.isSchemeGiven = true;
  changed();
}

function listenToSettings() {
  element('scheme').addEventListener('change', () => { chooseScheme(); schemeChanged(); });
  element('choice').addEventListener('change', schemeChanged);
  element('parameter').addEventListener('input', schemeChanged);
  element('overlay').addEventListener('change', drawPicture);
  element('strength').addEventListener('input', (event) => {
    event.target.setAttribute('aria-valuetext', `${event.target.value} %`);
    drawPicture();
  });
  element('layers').addEventListener('change', (event) => { state.layer = event.target.value; changed(); });
  element('home').addEventListener('click', () => { stop(); back(); });
  element('save-picture').addEventListener('click', savePicture);
  element('save').addEventListener('click', savePose);
  element('copy').addEventListener('click', copy);
  const redraw = () => { drawPicture(); drawMap(); };
  new ResizeObserver(redraw).observe(element('picture'));
  new ResizeObserver(redraw).observe(element('map'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
}

// Distance from a camera to the nearest other one, in the middle of all: frusta of this size do not cover each other.
function frustumDepth(sources, distance) {
  const gaps = sources.map((own) => Math.min(...sources.filter((other) => other !== own)
    .map((other) => length(sub(own.pose.centre, other.pose.centre))))).sort((a, b) => a - b);
  const gap = gaps[Math.floor(gaps.length / 2)];
  return clamp(Number.isFinite(gap) ? gap : distance, 0.04 * distance, 0.2 * distance);
}

async function begin() {
  listenToPicture(element('picture'));
  listenToMap(element('map'));
  listenToKeyboard();
  drawScale(element('scale'));
  drawScale(element('layer-scale'));
  if (matchMedia('(pointer: coarse)').matches) {
    element('picture').setAttribute('aria-label', 'The novel view. Drag with a finger to turn around the subject.');
  }
  watch();
  try {
    const found = await (await fetch('scene')).json();
    for (const camera of [...found.sources, ...found.others]) camera.pose = poseOf(camera.pose);
    found.start = poseOf(found.start);
    found.frustum = frustumDepth(found.sources, found.distance);
    state.scene = found;
  } catch (error) {
    told(error);
    return;
  }
  document.title = `${state.scene.name} · viewfuse`;
  element('name').textContent = state.scene.name;
  const { length: count } = state.scene.sources;
  element('about').textContent = `${count} source view${count === 1 ? '' : 's'}, ${state.scene.field} field on ${state.scene.device}`;
  element('picture').style.aspectRatio = state.scene.size.join(' / ');
  element('picture').style.maxWidth = `calc(68vh * ${state.scene.size[0] / state.scene.size[1]})`;
  state.pose = state.scene.start;
  state.focus = state.scene.focus;
  state.observer = firstObserver();
  showSources((own) => { stop(); goTo(own, state.scene.focus); });
  showSchemes(state.scene.scheme);
  state.first = state.scene.chooses ? null : state.scene.scheme;
  if (!state.scene.is_weighted) element('choosing').textContent = 'Weights only colour the cameras: these Gaussians are drawn without them.';
  listenToSettings();
  listenToKeyframes(goTo);
  listenToVideo();
  changed();
  const photographs = setInterval(() => {
    if (state.shown === null) return;
    clearInterval(photographs);
    showPhotographs();
  }, 50);
}

begin();
