// What is taken elsewhere: the view as a pose, and the command line that renders it.

import { matrixOf } from './poses.js';
import { element, state } from './state.js';

const FILE = 'view.json';

// In the coordinates of the scene's files, OpenGL axes, as NeRF's transforms.json.
function transforms() {
  const { right, down, forward, centre } = state.pose;
  const place = centre.map((x, i) => state.scene.origin[i] + state.scene.scale * x);
  const rows = [0, 1, 2].map((i) => [right[i], 0 - down[i], 0 - forward[i], place[i]]).concat([[0, 0, 0, 1]]);
  const { focal, principal, size } = state.scene.lens;
  return {
    camera_model: 'PINHOLE',
    w: size[0], h: size[1], fl_x: focal[0], fl_y: focal[1], cx: principal[0], cy: principal[1],
    frames: [{ file_path: 'view', transform_matrix: rows }],
  };
}

function command() {
  const { render, options, first_weights: first } = state.scene.commands;
  if (render === '') return '';
  // Words for a shell come from the program; a scheme of the menu has none that needs quotes.
  const weights = state.scheme === state.scene.scheme ? first : state.scheme;
  const matrix = JSON.stringify(matrixOf(state.pose));
  const own = state.scene.others.find((other) => JSON.stringify(matrixOf(other.pose)) === matrix);
  const target = own ? `--targets ${own.word}` : `--camera-path ${FILE}`;
  return `${render} ${target}${options} --weights ${weights} -o out`;
}

export function tellCommand() {
  element('command').textContent = command();
}

function said(text) {
  element('said').textContent = text;
}

export function save() {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([`${JSON.stringify(transforms(), null, 2)}\n`], { type: 'application/json' }));
  link.download = FILE;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  said(`Saved as ${FILE}.`);
}

export async function copy() {
  try {
    await navigator.clipboard.writeText(command());
    said(command().includes(FILE) ? `Copied. It reads ${FILE}: save the view as well.` : 'Copied.');
  } catch {
    getSelection().selectAllChildren(element('command'));
    said('The browser does not allow copying: the line is selected.');
  }
}
