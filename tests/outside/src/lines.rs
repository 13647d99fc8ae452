//! A layout of scenes.

use std::path::{Path, PathBuf};
use viewfuse::scene::reader::{
    ImageFile, PoseForm, RawIntrinsics, RawPose, RawScene, RawView, Reader, number_lines, read_text,
};
use viewfuse::scene::{FileFault, FilePlace, SceneError};

/// `cameras.list`: of `photograph_0.png` and so on a line each, the focal length, then the pose's upper three rows.
#[derive(Clone, Copy, Debug)]
pub struct Lines;

/// Name of the file.
pub const LIST: &str = "cameras.list";

impl Reader for Lines {
    fn name(&self) -> &'static str {
        "lines"
    }

    fn form(&self) -> &'static str {
        "a folder with cameras.list"
    }

    fn recognise(&self, path: &Path) -> Result<Option<PathBuf>, SceneError> {
        let list = path.join(LIST);
        Ok(list.is_file().then_some(list))
    }

    fn read(&self, list: &Path) -> Result<RawScene, SceneError> {
        let lines = number_lines(list, &read_text(list)?)?;
        let view = |(index, (line, numbers)): (usize, &(usize, Vec<f64>))| view(list, index, *line, numbers);
        Ok(RawScene::from(lines.iter().enumerate().map(view).collect::<Result<Vec<_>, _>>()?))
    }
}

fn view(list: &Path, index: usize, line: usize, numbers: &[f64]) -> Result<RawView, SceneError> {
    let place = FilePlace::line(list, line);
    let &[focal, a, b, c, x, d, e, f, y, g, h, i, z] = numbers else {
        return Err(place.fault(FileFault::WrongCount { of: "numbers", expected: 13, found: numbers.len() }));
    };
    let matrix = [[a, b, c, x], [d, e, f, y], [g, h, i, z], [0.0, 0.0, 0.0, 1.0]];
    let name = format!("photograph_{index}");
    let image = ImageFile::open(&list.with_file_name(format!("{name}.png")))?;
    let intrinsics = RawIntrinsics::centred(focal, image.size(), place.clone());
    let pose = RawPose { matrix, form: PoseForm::WorldFromOpenCv, place };
    Ok(RawView::new(name, Some(image), pose, Some(intrinsics)))
}
