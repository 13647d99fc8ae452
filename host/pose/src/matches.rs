//! Which photographs match which, where they fall apart, and what to photograph: what a refusal tells.

use crate::attempt::Attempt;
use crate::intake::Photo;
use viewfuse_job::text::listed;

/// Most names of a group that are told.
const MAX_NAMES: usize = 8;

/// Most partners of a photograph that are told.
const MAX_PARTNERS: usize = 6;

/// The matches of photographs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matches {
    /// The photographs.
    pub names: Vec<String>,
    /// For every two of them that match, the first before the second: how many matches one geometry explains, the most
    /// of any attempt.
    pub pairs: Vec<(usize, usize, usize)>,
}

impl Matches {
    /// Of the attempts at these photographs.
    pub(crate) fn of(photos: &[Photo], attempts: &[Attempt]) -> Matches {
        let mut counts = vec![vec![0_usize; photos.len()]; photos.len()];
        for solution in attempts.iter().filter_map(|attempt| attempt.solution.as_ref()) {
            // Not every solver says its pairs; its points are what is left of them.
            let mut shared = vec![vec![0_usize; photos.len()]; photos.len()];
            for point in &solution.points {
                let mut seen: Vec<usize> = point.seen.iter().map(|(photo, _)| *photo).collect();
                seen.sort_unstable();
                seen.dedup();
                for (place, &b) in seen.iter().enumerate() {
                    seen[..place].iter().for_each(|a| shared[*a][b] += 1);
                }
            }
            for pair in &solution.pairs {
                let [a, b] = pair.photographs;
                shared[a.min(b)][a.max(b)] = pair.inliers;
            }
            counts
                .iter_mut()
                .flatten()
                .zip(shared.iter().flatten())
                .for_each(|(most, count)| *most = (*most).max(*count));
        }
        let pairs = (0..photos.len()).flat_map(|a| (a + 1..photos.len()).map(move |b| (a, b)));
        let pairs = pairs.map(|(a, b)| (a, b, counts[a][b])).filter(|(.., count)| *count > 0);
        Matches { names: photos.iter().map(|photo| photo.name.clone()).collect(), pairs: pairs.collect() }
    }

    /// Fewest matches that tie two photographs: by chance, photographs that show nothing in common have up to 50 that
    /// one geometry explains.
    pub const MIN_TIE: usize = 50;

    /// The photographs that match one, the most matches first.
    pub fn partners(&self, photo: usize) -> Vec<(usize, usize)> {
        let partner = |(a, b, count): &(usize, usize, usize)| match (*a == photo, *b == photo) {
            (true, _) => Some((*b, *count)),
            (_, true) => Some((*a, *count)),
            _ => None,
        };
        let mut partners: Vec<_> = self.pairs.iter().filter_map(partner).collect();
        partners.sort_by_key(|(photo, count)| (std::cmp::Reverse(*count), *photo));
        partners
    }

    /// Whether two photographs have as many matches as tie them.
    pub(crate) fn are_tied(&self, a: usize, b: usize) -> bool {
        let is_it = |(one, other, count): &(usize, usize, usize)| {
            (*one, *other) == (a.min(b), a.max(b)) && *count >= Matches::MIN_TIE
        };
        self.pairs.iter().any(is_it)
    }

    /// Whether a photograph that is not one of these is tied to another one.
    pub(crate) fn tie_more_than(&self, photos: &[usize]) -> bool {
        let is_more = |photo: &usize| !photos.contains(photo);
        self.pairs.iter().any(|(a, b, count)| *count >= Matches::MIN_TIE && (is_more(a) || is_more(b)))
    }

    /// The pairs by name.
    pub fn named(&self) -> impl Iterator<Item = (&str, &str, usize)> {
        self.pairs.iter().map(|(a, b, count)| (self.names[*a].as_str(), self.names[*b].as_str(), *count))
    }

    /// What one matches, in words.
    pub fn told(&self, photo: usize) -> String {
        let partner = |(photo, count): (usize, usize)| format!("{} {count}", self.names[photo]);
        let partners: Vec<String> = self.partners(photo).into_iter().map(partner).collect();
        if partners.is_empty() { "none".to_owned() } else { listed(&partners, MAX_PARTNERS) }
    }

    /// The photographs that are tied to one another, over others if need be: the largest group first.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut group: Vec<usize> = (0..self.names.len()).collect();
        for &(a, b, _) in self.pairs.iter().filter(|(.., count)| *count >= Matches::MIN_TIE) {
            let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
            group.iter_mut().filter(|name| **name == from).for_each(|name| *name = to);
        }
        let members = |first: usize| (0..group.len()).filter(|photo| group[*photo] == first).collect::<Vec<_>>();
        let mut groups: Vec<Vec<usize>> = (0..group.len()).map(members).filter(|members| !members.is_empty()).collect();
        groups.sort_by_key(|members| (std::cmp::Reverse(members.len()), members[0]));
        groups
    }

    /// Where the photographs fall apart, and what to photograph.
    pub fn diagnosis(&self) -> String {
        let groups = self.groups();
        let steps = "neighbouring views not more than 15 degrees apart and the camera moved, not only turned";
        if self.pairs.is_empty() {
            return format!(
                "no two photographs match by surfaces at several depths: they have too little in common, or show one \
                 flat surface, or the camera only turned; photograph with textured surfaces in view, {steps}"
            );
        }
        if let [_] = groups[..] {
            return format!("all photographs are tied by matches: photograph more of them, {steps}");
        }
        let (tied, alone): (Vec<_>, Vec<_>) = groups.iter().partition(|group| group.len() > 1);
        let list = |photos: &[usize]| {
            let names: Vec<&String> = photos.iter().map(|photo| &self.names[*photo]).collect();
            listed(&names, MAX_NAMES)
        };
        let tied: Vec<String> = tied.iter().map(|group| list(group)).collect();
        let alone: Vec<usize> = alone.into_iter().flatten().copied().collect();
        let mut parts = Vec::new();
        if !tied.is_empty() {
            let word = if tied.len() == 1 { "group" } else { "groups" };
            parts.push(format!("{} {word} ({})", tied.len(), tied.join("; ")));
        }
        if !alone.is_empty() {
            parts.push(format!("{} alone ({})", alone.len(), list(&alone)));
        }
        let group_of = |photo: usize| groups.iter().position(|group| group.contains(&photo));
        let across = self.pairs.iter().filter(|(a, b, _)| group_of(*a) != group_of(*b));
        let between = match across.max_by_key(|(.., count)| *count) {
            Some((a, b, _)) => format!("between {} and {} first", self.names[*a], self.names[*b]),
            None => "between them".to_owned(),
        };
        format!("the photographs fall apart into {}: take some {between}, {steps}", parts.join(" and "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matches(count: usize, pairs: &[(usize, usize, usize)]) -> Matches {
        Matches { names: (0..count).map(|photo| format!("{photo}.jpg")).collect(), pairs: pairs.to_vec() }
    }

    #[test]
    fn where_photographs_fall_apart_is_told() {
        let parts = |pairs: &[(usize, usize, usize)], parts: &[&str]| {
            let told = matches(5, pairs).diagnosis();
            assert!(parts.iter().all(|part| told.contains(part)), "{told}");
        };
        parts(&[], &["no two photographs match", "textured", "15 degrees"]);
        parts(&[(0, 1, 300), (1, 2, 90), (2, 3, 60), (3, 4, 50)], &["all photographs are tied"]);
        let torn = [(0, 3, 49), (0, 4, 200), (1, 2, 90), (2, 4, 17)];
        parts(
            &torn,
            &["into 2 groups (0.jpg, 4.jpg; 1.jpg, 2.jpg) and 1 alone (3.jpg): take some between 0.jpg and 3.jpg \
                    first"],
        );
    }

    #[test]
    fn partners_come_with_the_most_matches_first() {
        let all: Vec<_> = (1..9).map(|photo| (0, photo, 10 * photo)).collect();
        let found = matches(10, &all);
        assert_eq!(found.told(0), "8.jpg 80, 7.jpg 70, 6.jpg 60, 5.jpg 50, 4.jpg 40, 3.jpg 30 and 2 more");
        assert_eq!((found.told(8).as_str(), found.told(9).as_str()), ("0.jpg 80", "none"));
    }
}
