//! Numbers of scores as JSON.

/// Largest score of any metric, up to its sign; larger ones are not of this program.
const MAX_SCORE: f64 = 1.0e9;
/// Longest time of a picture, in seconds.
const LONGEST_TIME: f64 = 1.0e9;

/// A score's values as JSON: numbers that JSON cannot hold (the PSNR of equal pictures is infinite) as text.
pub(crate) mod values {
    use super::MAX_SCORE;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Number {
        Finite(f64),
        Other(String),
    }

    pub(crate) fn serialize<S: Serializer>(values: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
        let number =
            |value: f64| if value.is_finite() { Number::Finite(value) } else { Number::Other(value.to_string()) };
        serializer.collect_seq(values.iter().map(|(name, value)| (name, number(*value))))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<(String, f64)>, D::Error> {
        let value = |(name, number): (String, Number)| {
            let (value, text) = match number {
                Number::Finite(value) => (Some(value), format!("{value:e}")),
                Number::Other(text) => (text.parse().ok(), text),
            };
            match value.filter(|value: &f64| !value.is_finite() || value.abs() <= MAX_SCORE) {
                Some(value) => Ok((name, value)),
                None => Err(D::Error::custom(format!("{name} is '{text}'"))),
            }
        };
        Vec::deserialize(deserializer)?.into_iter().map(value).collect()
    }
}

/// A time of a picture as seconds.
pub(crate) mod seconds {
    use super::LONGEST_TIME;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};
    use std::time::Duration;

    pub(crate) fn serialize<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(time.as_secs_f64())
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
        let seconds = f64::deserialize(deserializer)?;
        if !(0.0..=LONGEST_TIME).contains(&seconds) {
            return Err(D::Error::custom(format!("seconds is '{seconds:e}'")));
        }
        Duration::try_from_secs_f64(seconds).map_err(D::Error::custom)
    }
}
