//! What was found in photographs and between them, for the next job with the same ones: attempts differ in focal
//! lengths, which neither features nor matches depend on, and those take three quarters of an attempt's time.

use crate::job::{Features, PoseJob};
use openmvg_sfm::model::ImageMeta;
use openmvg_sfm::unstable::ExtractedFeatures;
use openmvg_sfm::unstable::backends::{
    FeatureContext, FeatureExtractor, PairContext, PairMatcher, PairMatcherPreparation, PreparedPairMatcher,
};
use openmvg_sfm::unstable::types::PairMatches;
use openmvg_sfm::{Result, ViewPair};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// All that features and matches depend on.
#[derive(PartialEq)]
struct Key {
    seed: u64,
    features: Features,
    max_side: u32,
    photographs: Vec<(PathBuf, [u32; 2])>,
}

impl Key {
    fn of(job: &PoseJob) -> Key {
        let photographs = job.photographs.iter().map(|photograph| (photograph.path.clone(), photograph.size));
        Key { seed: job.seed, features: job.features, max_side: job.max_side, photographs: photographs.collect() }
    }
}

/// What is remembered, of one set of photographs for each kind of features.
#[derive(Default)]
pub(crate) struct Remembered(Vec<(Key, Found)>);

impl Remembered {
    /// That of a job's photographs.
    pub(crate) fn of(&mut self, job: &PoseJob) -> &Found {
        let key = Key::of(job);
        self.0.retain(|(known, _)| known.features != key.features || *known == key);
        let place = self.0.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
            self.0.push((key, Found::default()));
            self.0.len() - 1
        });
        &self.0[place].1
    }
}

/// Features by the number of their photograph, and matches.
#[derive(Default)]
pub(crate) struct Found {
    features: Mutex<BTreeMap<usize, ExtractedFeatures>>,
    matches: Mutex<BTreeMap<ViewPair, PairMatches>>,
}

/// Nothing panics while it is held.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is found once.
pub(crate) struct Once<'a, T: ?Sized> {
    pub(crate) found: &'a Found,
    pub(crate) by: &'a T,
}

impl FeatureExtractor for Once<'_, dyn FeatureExtractor> {
    fn extract(&self, context: &FeatureContext, meta: &ImageMeta) -> Result<ExtractedFeatures> {
        let view = context.view.index();
        if let Some(features) = lock(&self.found.features).get(&view) {
            return Ok(features.clone());
        }
        let features = self.by.extract(context, meta)?;
        lock(&self.found.features).insert(view, features.clone());
        Ok(features)
    }

    fn worker_memory_gib(&self) -> f64 {
        self.by.worker_memory_gib()
    }
}

impl PairMatcher for Once<'_, dyn PairMatcher> {
    fn prepare<'a>(&'a self, context: PairMatcherPreparation<'a>) -> Result<Option<Box<dyn PreparedPairMatcher + 'a>>> {
        // An index of each photograph's features serves those that are to be matched.
        if context.pairs().iter().all(|pair| lock(&self.found.matches).contains_key(pair)) {
            return Ok(None);
        }
        let prepared = self.by.prepare(context)?;
        Ok(prepared.map(|by| Box::new(Prepared { found: self.found, by }) as Box<dyn PreparedPairMatcher + 'a>))
    }

    fn match_features(
        &self,
        context: &PairContext,
        first: &ExtractedFeatures,
        second: &ExtractedFeatures,
    ) -> Result<PairMatches> {
        self.found.matches(context, || self.by.match_features(context, first, second))
    }
}

/// Matches that are found once, by an index.
struct Prepared<'a> {
    found: &'a Found,
    by: Box<dyn PreparedPairMatcher + 'a>,
}

impl PreparedPairMatcher for Prepared<'_> {
    fn match_pair(&self, context: &PairContext) -> Result<PairMatches> {
        self.found.matches(context, || self.by.match_pair(context))
    }
}

impl Found {
    fn matches(&self, context: &PairContext, find: impl FnOnce() -> Result<PairMatches>) -> Result<PairMatches> {
        if let Some(matches) = lock(&self.matches).get(&context.pair) {
            return Ok(matches.clone());
        }
        let matches = find()?;
        lock(&self.matches).insert(context.pair, matches.clone());
        Ok(matches)
    }
}
