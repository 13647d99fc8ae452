//! Photographs that a list names and that do not exist: they are skipped and counted, with one warning for all.

use std::path::{Path, PathBuf};

use super::error::{SceneError, SceneFault};
use super::fault::FilePlace;
use super::files::IMAGE_FOLDERS;

/// The file of a photograph's name beside the list that names another place for it, perhaps on another machine.
fn beside(list: &Path, image: &Path) -> Option<PathBuf> {
    let (folder, name) = (list.parent()?, image.file_name()?);
    let places = [""].iter().chain(IMAGE_FOLDERS.iter()).map(|place| folder.join(place).join(name));
    places.into_iter().find(|found| found.is_file())
}

/// The photographs of a list that are missing.
#[derive(Debug, Default)]
pub(super) struct Missing {
    listed: usize,
    count: usize,
    first: Option<(FilePlace, PathBuf)>,
}

impl Missing {
    /// Counts a photograph of the list that exists.
    pub(super) fn found(&mut self) {
        self.listed += 1;
    }

    /// Counts a photograph of the list that does not exist; `place` is its place in the list.
    pub(super) fn missed(&mut self, place: FilePlace, image: PathBuf) {
        self.listed += 1;
        self.count += 1;
        self.first.get_or_insert((place, image));
    }

    /// The warning, if any is missing; `list` is the file that names them.
    ///
    /// # Errors
    /// [`SceneFault::PoseWithoutImage`] if all are missing.
    pub(super) fn warning(self, list: &Path) -> Result<Option<String>, SceneError> {
        let Missing { listed, count, first } = self;
        match first {
            Some((place, image)) if count == listed => Err(place.fault(match beside(list, &image) {
                Some(found) => SceneFault::PoseWithImageElsewhere(image, found),
                None => SceneFault::PoseWithoutImage(image),
            })),
            Some((_, image)) => Ok(Some(format!(
                "{}: {count} of {listed} photographs are not there and excluded (the first is {})",
                list.display(),
                image.display()
            ))),
            None => Ok(None),
        }
    }
}
