//! What `--model` takes.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use viewfuse_field::{genvs, pixelnerf};
use viewfuse_nn::checkpoint::Checkpoint;

/// Where a network's parameters come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Model {
    /// A checkpoint.
    File(PathBuf),
    /// PixelNeRF, computed from the tensors' names; the width of a small member of the family, or the published size.
    Formula(Option<u16>),
    /// PixelNeRF, a solid body, for measuring.
    Body(Option<u16>),
    /// GeNVS, computed from the tensors' names: the small member of its family, or the published size.
    Genvs { small: bool },
}

impl FromStr for Model {
    type Err = String;

    fn from_str(text: &str) -> Result<Model, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let width = || match size.map(str::parse::<u16>) {
            None => Ok(None),
            Some(Ok(width)) if (8..=2048).contains(&width) && width % 8 == 0 => Ok(Some(width)),
            Some(_) => Err(format!("'{text}': a width is a multiple of 8 from 8 to 2048")),
        };
        match name {
            "formula" => Ok(Model::Formula(width()?)),
            "body" => Ok(Model::Body(width()?)),
            "genvs" => match size {
                None => Ok(Model::Genvs { small: false }),
                Some("small") => Ok(Model::Genvs { small: true }),
                Some(_) => Err(format!("'{text}': there is genvs, of the published size, and genvs:small")),
            },
            _ => Ok(Model::File(PathBuf::from(text))),
        }
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, width) = match self {
            Model::File(path) => return write!(f, "{}", path.display()),
            Model::Formula(width) => ("formula", width),
            Model::Body(width) => ("body", width),
            Model::Genvs { small } => return f.write_str(if *small { "genvs:small" } else { "genvs" }),
        };
        match width {
            Some(width) => write!(f, "{name}:{width}"),
            None => f.write_str(name),
        }
    }
}

impl Model {
    /// The parameters.
    pub(crate) fn checkpoint(&self) -> anyhow::Result<Checkpoint> {
        let sizes = |width: &Option<u16>| match width {
            Some(width) => pixelnerf::Architecture::small(usize::from(*width)),
            None => pixelnerf::Architecture::published(),
        };
        Ok(match self {
            Model::File(path) => Checkpoint::open(path)?,
            Model::Formula(width) => pixelnerf::test_networks::deterministic(&sizes(width)),
            Model::Body(width) => pixelnerf::test_networks::body(&sizes(width)),
            Model::Genvs { small: true } => genvs::test_networks::deterministic(&genvs::Architecture::small()),
            Model::Genvs { small: false } => genvs::test_networks::deterministic(&genvs::Architecture::published()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Model;

    #[test]
    fn models_by_name() {
        for text in ["formula", "formula:64", "body", "body:16", "genvs", "genvs:small", "network-snapshot-005000.pkl"]
        {
            let model: Model = text.parse().expect(text);
            assert_eq!(model.to_string(), text);
            assert_eq!(matches!(model, Model::File(_)), text.ends_with(".pkl"));
        }
        for text in ["formula:7", "body:", "genvs:", "genvs:64", "genvs:Small"] {
            let message = text.parse::<Model>().expect_err(text);
            assert!(message.starts_with(&format!("'{text}': ")), "{message}");
        }
    }
}
