// What is saved as files: pictures with their records, poses and paths.

import { element, state } from './state.js';

// What was done, in words.
export function said(text) {
  element('said').textContent = text;
}

// A name by what is saved of this scene: a second file of one name would get another from the browser, and a command that
// names it would read the first.
export function nameOf(stem, end, content) {
  const { origin, scale, lens, commands } = state.scene;
  let mark = 0x811c9dc5;
  for (const letter of JSON.stringify([content, origin, scale, lens, commands])) mark = Math.imul(mark ^ letter.codePointAt(0), 0x01000193);
  return `${stem}-${(mark >>> 0).toString(16).padStart(8, '0')}${end}`;
}

export function saveFile(name, content, type) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

export function saveJson(name, value) {
  saveFile(name, `${JSON.stringify(value, null, 2)}\n`, 'application/json');
}

// In the coordinates of the scene's files, OpenGL axes, as NeRF's transforms.json. `frames` are names and poses.
export function transforms(frames, more) {
  const { origin, scale, lens: { focal, principal, size } } = state.scene;
  const matrix = ({ right, down, forward, centre }) => [0, 1, 2]
    .map((i) => [right[i], 0 - down[i], 0 - forward[i], origin[i] + scale * centre[i]]).concat([[0, 0, 0, 1]]);
  return {
    camera_model: 'PINHOLE',
    w: size[0], h: size[1], fl_x: focal[0], fl_y: focal[1], cx: principal[0], cy: principal[1],
    ...more,
    frames: frames.map(([name, pose]) => ({ file_path: name, transform_matrix: matrix(pose) })),
  };
}
