//! COLMAP's text files: lines of words, `#` before comments.

use std::path::Path;

use super::super::camera_models::CameraModel;
use super::super::error::SceneError;
use super::super::fault::{FaultLocation, FileFault, FilePlace};
use super::super::files::{self, MAX_FILE, number, read_text_of};
use super::{ModelCamera, ModelImage, ModelPoint, camera};

/// The lines that are not comments, numbered from 1. Blank ones are kept: `images.txt` has them.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    numbered.filter(|(_, line)| !line.starts_with('#'))
}

/// A whole number that is not negative.
fn whole(path: &Path, line: usize, word: &str) -> Result<u32, SceneError> {
    let fault = || FilePlace::line(path, line).fault(FileFault::NotWhole(files::excerpt(word)));
    word.parse().map_err(|_| fault())
}

fn too_few(path: &Path, line: usize, of: &'static str, expected: usize, found: usize) -> SceneError {
    FilePlace::line(path, line).fault(FileFault::WrongCount { of, expected, found })
}

/// `cameras.txt`: `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`.
pub(super) fn cameras(path: &Path) -> Result<Vec<(u32, ModelCamera)>, SceneError> {
    let text = read_text_of(path, MAX_FILE)?;
    let mut all = Vec::new();
    for (line, content) in lines(&text).filter(|(_, content)| !content.is_empty()) {
        let words: Vec<&str> = content.split_whitespace().collect();
        let [id, name, width, height, parameters @ ..] = &words[..] else {
            return Err(too_few(path, line, "words of a camera", 4, words.len()));
        };
        let id = whole(path, line, id)?;
        let size = [number(path, line, width)?, number(path, line, height)?];
        let parameters = parameters.iter().map(|word| number(path, line, word)).collect::<Result<Vec<_>, _>>()?;
        let model = CameraModel::named(name).ok_or_else(|| files::excerpt(name));
        all.push((id, camera(FilePlace::line(path, line), model, size, &parameters)?));
    }
    Ok(all)
}

/// `images.txt`: of each image `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, then a line of the points found in it,
/// which is skipped. Files without these second lines are read, too.
pub(super) fn images(path: &Path) -> Result<Vec<ModelImage>, SceneError> {
    let text = read_text_of(path, MAX_FILE)?;
    let mut all = Vec::new();
    let mut lines = lines(&text).peekable();
    while let Some((line, content)) = lines.next() {
        if content.is_empty() {
            continue;
        }
        all.push(image(path, line, content)?);
        lines.next_if(|(_, next)| is_points(next));
    }
    Ok(all)
}

/// Whether a line lists points in an image: `X Y POINT3D_ID` each, or nothing. An image's line has a name in tenth
/// place.
fn is_points(line: &str) -> bool {
    let mut words = 0;
    line.split_whitespace().inspect(|_| words += 1).all(|word| word.parse::<f64>().is_ok()) && words % 3 == 0
}

fn image(path: &Path, line: usize, content: &str) -> Result<ModelImage, SceneError> {
    let words: Vec<&str> = content.split_whitespace().collect();
    if words.len() < 10 {
        return Err(too_few(path, line, "words of an image", 10, words.len()));
    }
    let numbers = |range: std::ops::Range<usize>| -> Result<Vec<f64>, SceneError> {
        words[range].iter().map(|word| number(path, line, word)).collect()
    };
    let (rotation, translation) = (numbers(1..5)?, numbers(5..8)?);
    Ok(ModelImage {
        id: whole(path, line, words[0])?,
        rotation: std::array::from_fn(|index| rotation[index]),
        translation: std::array::from_fn(|index| translation[index]),
        camera: whole(path, line, words[8])?,
        name: behind(content, 9).to_string(),
        place: FilePlace::line(path, line),
    })
}

/// The rest of a line after this many words: a name may contain spaces.
fn behind(content: &str, words: usize) -> &str {
    let mut rest = content.trim();
    for _ in 0..words {
        rest = rest.split_once(char::is_whitespace).map_or("", |(_, rest)| rest).trim_start();
    }
    rest
}

/// `points3D.txt`: `POINT3D_ID X Y Z R G B ERROR` and `IMAGE_ID POINT2D_IDX` of each image that saw it.
pub(super) fn points(path: &Path) -> Result<Vec<ModelPoint>, SceneError> {
    let text = read_text_of(path, MAX_FILE)?;
    let mut all = Vec::new();
    for (line, content) in lines(&text).filter(|(_, content)| !content.is_empty()) {
        let words: Vec<&str> = content.split_whitespace().collect();
        let [_, x, y, z, red, green, blue, error, track @ ..] = &words[..] else {
            return Err(too_few(path, line, "words of a point", 8, words.len()));
        };
        if track.len() % 2 != 0 {
            return Err(too_few(path, line, "words of a point", words.len() + 1, words.len()));
        }
        let mut position = [0.0; 3];
        for (coordinate, word) in position.iter_mut().zip([x, y, z]) {
            *coordinate = number(path, line, word)?;
        }
        let mut colour = [0; 3];
        for (level, word) in colour.iter_mut().zip([red, green, blue]) {
            *level = whole(path, line, word)?.min(255) as u8;
        }
        let images = track.iter().step_by(2).map(|word| whole(path, line, word)).collect::<Result<Vec<_>, _>>()?;
        // One that is not finite is not known, as in binary files.
        let error = match error.parse::<f64>() {
            Ok(value) if !value.is_finite() => -1.0,
            _ => number(path, line, error)?,
        };
        let location = FaultLocation::Line(line);
        all.push(ModelPoint { position, colour, error, images, location });
    }
    Ok(all)
}
