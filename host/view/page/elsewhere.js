// What is taken elsewhere: the picture with its record, the view as a pose, and the command line that renders it.

import { nameOf, said, saveFile, saveJson, transforms } from './files.js';
import { matrixOf } from './poses.js';
import { element, state } from './state.js';

const fileOf = (pose) => nameOf('view', '.json', matrixOf(pose));

// A command line that renders a target. Words for a shell come from the program; a scheme of the menu has none that needs
// quotes. `isFirst`: with the scheme that the command line began with, or with what was chosen for the scene.
export function commandOf(target, isFirst = state.scheme === state.first) {
  const { render, options, first_weights: first } = state.scene.commands;
  if (render === '') return '';
  return `${render} ${target}${options} --weights ${isFirst ? first : state.scheme} -o out`;
}

function command(isFirst) {
  const matrix = JSON.stringify(matrixOf(state.pose));
  const own = state.scene.others.find((other) => JSON.stringify(matrixOf(other.pose)) === matrix);
  return commandOf(own ? `--targets ${own.word}` : `--camera-path ${fileOf(state.pose)}`, isFirst);
}

export function tellCommand() {
  element('command').textContent = command();
}

export function savePose() {
  saveJson(fileOf(state.pose), transforms([['view', state.pose]]));
  said(`Saved as ${fileOf(state.pose)}.`);
}

let isPictureWanted = false;

// Saves the full picture of this view, at once or when it has come.
export function savePicture() {
  isPictureWanted = true;
  said('The full picture is saved as soon as it is there.');
  saveWantedPicture();
}

export function saveWantedPicture() {
  const own = state.shown;
  if (!isPictureWanted || !own || !own.full || own.pose !== state.pose || own.scheme !== state.scheme) return;
  isPictureWanted = false;
  const [picture, record] = [['view', '.png'], ['run', '.json']]
    .map(([stem, end]) => nameOf(stem, end, [matrixOf(own.pose), own.scheme]));
  saveFile(picture, own.file, 'image/png');
  // A picture of before the choice has its scheme, perhaps, but not what was chosen along with it.
  const isFirst = state.scene.chooses ? own.record.chosen !== null : undefined;
  saveJson(record, { command: command(isFirst), ...own.record });
  said(`Saved as ${picture}, with its record ${record}.`);
}

export async function copy() {
  try {
    await navigator.clipboard.writeText(command());
    const file = fileOf(state.pose);
    said(command().includes(file) ? `Copied. It reads ${file}: save the view as well.` : 'Copied.');
  } catch {
    getSelection().selectAllChildren(element('command'));
    said('The browser does not allow copying: the line is selected.');
  }
}
