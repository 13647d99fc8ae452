//! The values of `--model`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use viewfuse_field::AnyField;
use viewfuse_field::options::{Given, OpenError};
use viewfuse_field::row::{Origin, Row, Small, TestNetwork};
use viewfuse_field::rows::{self, ROWS};
use viewfuse_nn::checkpoint::Checkpoint;

/// Help of `--model`: the networks that checkpoints may hold, test networks, and fields without one.
pub(crate) fn model_help() -> String {
    let learned = || ROWS.into_iter().filter(|row| matches!(row.origin, Origin::Learned { .. }));
    let networks: Vec<String> = learned().map(|row| format!("a {}", row.title)).collect();
    let sizes = |network: &TestNetwork| match network.small {
        Small::Width => format!("{}[:WIDTH]", network.name),
        Small::One => format!("{}[:small]", network.name),
    };
    let tests = learned()
        .map(|row| format!("{} ({})", row.test_networks().iter().map(sizes).collect::<Vec<_>>().join(", "), row.title));
    let others: Vec<&str> = ROWS.iter().filter(|row| row.prefix().is_none()).map(|row| row.name).collect();
    format!(
        "Checkpoint of {} (.pth, .pt, .safetensors, .pkl), or a test network with deterministic initialisation: {}, or \
         a field without a network: {} [default: {}]",
        networks.join(" or "),
        tests.collect::<Vec<_>>().join(", "),
        others.join(", "),
        ROWS[0].name
    )
}

/// A field without a network, or the source of a network's parameters.
#[derive(Clone)]
pub(crate) enum Model {
    /// A checkpoint.
    File(PathBuf),
    /// A test network: the published size, or a small member of its family.
    Test(&'static TestNetwork, Option<u16>),
    /// A field without a network.
    TrainingFree(&'static Row),
}

impl FromStr for Model {
    type Err = String;

    fn from_str(text: &str) -> Result<Model, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        if let Some(row) = ROWS.into_iter().find(|row| row.prefix().is_none() && row.name == text) {
            return Ok(Model::TrainingFree(row));
        }
        let mut networks = ROWS.into_iter().flat_map(Row::test_networks);
        let Some(network) = networks.find(|network| network.name == name) else {
            let path = PathBuf::from(text);
            if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply")) {
                return Err(format!(
                    "'{text}': a .ply holds no network; `viewfuse render --gaussians FILE` shows Gaussians"
                ));
            }
            return Ok(Model::File(path));
        };
        let size = match (network.small, size) {
            (_, None) => None,
            (Small::One, Some("small")) => Some(0),
            (Small::One, Some(_)) => {
                return Err(format!("'{text}': the sizes are {name}, the published one, and {name}:small"));
            }
            (Small::Width, Some(width)) => match width.parse::<u16>() {
                Ok(width) if (8..=2048).contains(&width) && width % 8 == 0 => Some(width),
                _ => return Err(format!("'{text}': a width is a multiple of 8 from 8 to 2048")),
            },
        };
        Ok(Model::Test(network, size))
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Model::File(path) => write!(f, "{}", path.display()),
            Model::TrainingFree(row) => f.write_str(row.name),
            Model::Test(network, None) => f.write_str(network.name),
            Model::Test(TestNetwork { name, small: Small::One, .. }, Some(_)) => write!(f, "{name}:small"),
            Model::Test(TestNetwork { name, small: Small::Width, .. }, Some(width)) => write!(f, "{name}:{width}"),
        }
    }
}

impl Model {
    /// Whether there are parameters.
    pub(crate) fn is_network(&self) -> bool {
        !matches!(self, Model::TrainingFree(_))
    }

    /// Opens the field.
    pub(crate) fn open(&self, given: &Given) -> Result<AnyField, OpenError> {
        match self {
            Model::File(path) => rows::open(Checkpoint::open(path)?, given),
            Model::Test(network, size) => rows::open((network.checkpoint)(*size), given),
            Model::TrainingFree(row) => row.open(given),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Model;

    #[test]
    fn the_help_names_every_test_network() {
        assert_eq!(
            super::model_help(),
            "Checkpoint of a PixelNeRF or a GeNVS (.pth, .pt, .safetensors, .pkl), or a test network with \
             deterministic initialisation: formula[:WIDTH], body[:WIDTH] (PixelNeRF), genvs[:small] (GeNVS), or a \
             field without a network: training-free, plane-sweep, gaussians [default: training-free]"
        );
    }

    #[test]
    fn models_by_name() {
        for text in
            ["formula", "formula:64", "body", "body:16", "genvs", "genvs:small", "plane-sweep", "network-005000.pkl"]
        {
            let model: Model = text.parse().expect(text);
            assert_eq!(model.to_string(), text);
            assert_eq!(matches!(model, Model::File(_)), text.ends_with(".pkl"));
        }
        for text in ["formula:7", "body:", "genvs:", "genvs:64", "genvs:Small"] {
            let message = text.parse::<Model>().err().expect(text);
            assert!(message.starts_with(&format!("'{text}': ")), "{message}");
        }
    }
}
