// Answers of the program: a picture and a layer, out of bytes.

import { LEVELS } from './colours.js';

// The memory of a picture that is replaced: the browser would keep it for a while.
export function release(old) {
  if (old === null) return;
  old.bitmap.close();
  if (old.layer) old.layer.bitmap.close();
}

// 4 bytes length of the JSON, the JSON, the picture, the layer.
export async function unpacked(buffer) {
  const start = 4 + new DataView(buffer).getUint32(0, true);
  const answer = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, start - 4)));
  const end = start + answer.picture.bytes;
  answer.file = new Blob([buffer.slice(start, end)], { type: answer.picture.media_type });
  answer.bitmap = await createImageBitmap(answer.file);
  if (answer.layer) answer.layer.bitmap = await coloured(answer.size, new Uint8Array(buffer, end), answer.layer.has_gaps);
  return answer;
}

// Levels of one byte as colours; level 0 may mean that nothing is there.
function coloured([width, height], levels, hasGaps) {
  const image = new ImageData(width, height);
  levels.forEach((level, i) => {
    const isGap = hasGaps && level === 0;
    image.data.set(isGap ? [0, 0, 0, 255] : [...LEVELS[level], 255], 4 * i);
  });
  return createImageBitmap(image);
}
