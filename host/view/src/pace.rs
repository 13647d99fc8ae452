//! How coarse a picture has to be to come in time, from the times of the pictures before.

use crate::request::{COARSE_SIDE, MAX_LIVE_SIDE};
use std::time::Duration;

/// Time of a coarse picture and its encoding that is aimed at: with the way to the page it makes ten pictures a second.
pub(crate) const TIME_OF_A_PICTURE: Duration = Duration::from_millis(80);
/// The same for a live field: thirty a second. A device that is faster makes more of the largest pictures.
const TIME_OF_A_LIVE_PICTURE: Duration = Duration::from_millis(25);

/// Longest sides of coarse pictures as shares of the largest one, in 16ths.
const SIXTEENTHS: [u32; 9] = [16, 13, 10, 8, 6, 5, 4, 3, 2];
/// The least of the longest sides, in pixels.
const MIN_SIDE: u32 = 40;
/// Longest side of a live field's first pictures, in pixels: what two cores draw in time.
const FIRST_LIVE_SIDE: u32 = 320;

/// Times that a size is judged by: the median of so many.
const MEMORY: usize = 3;

/// The choice of the coarse pictures' size.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    /// Time of a picture that is aimed at.
    aim: Duration,
    /// Longest side of the largest pictures.
    pub(crate) largest: u32,
    /// Index into [`SIXTEENTHS`].
    step: usize,
    /// Times of the last pictures of that size.
    times: Vec<Duration>,
}

impl Pace {
    /// For full pictures of this longest side. Those of a live field ([`viewfuse_field::About::is_live`]) are as large,
    /// where a device draws them in time, which is tried from smaller ones on; others begin with the largest.
    pub(crate) fn of(is_live: bool, full_side: u32) -> Pace {
        let (aim, largest, first) = match is_live {
            true => (TIME_OF_A_LIVE_PICTURE, full_side.min(MAX_LIVE_SIDE), FIRST_LIVE_SIDE),
            false => (TIME_OF_A_PICTURE, COARSE_SIDE, COARSE_SIDE),
        };
        let mut pace = Pace { aim, largest, step: 0, times: Vec::new() };
        while pace.side(largest) > first && pace.has_coarser() {
            pace.step += 1;
        }
        pace
    }

    /// Whether there is a coarser size.
    fn has_coarser(&self) -> bool {
        SIXTEENTHS.get(self.step + 1).is_some_and(|share| self.largest * share / 16 >= MIN_SIDE)
    }

    /// Whether pictures come thirty a second. Then they are never full ones, whose record and encoding take longer than
    /// the picture.
    pub(crate) fn is_live(&self) -> bool {
        self.aim == TIME_OF_A_LIVE_PICTURE
    }

    /// Longest side for the next picture, of at most `most` pixels; at least 1.
    pub(crate) fn side(&self, most: u32) -> u32 {
        (most.min(self.largest) * SIXTEENTHS[self.step] / 16).max(1)
    }

    /// The last picture and its encoding took so long: coarser pictures follow if it was too long, finer ones if those should be in time
    /// as well. Time is assumed to be linear in the pixels.
    pub(crate) fn took(&mut self, time: Duration) {
        self.times.push(time);
        if self.times.len() < MEMORY {
            return;
        }
        let mut sorted = self.times.clone();
        sorted.sort_unstable();
        let median = sorted[MEMORY / 2];
        self.times.remove(0);
        let finer = self.step.checked_sub(1).map(|finer| {
            let [side, finer] = [self.step, finer].map(|step| f64::from(SIXTEENTHS[step]));
            median.mul_f64((finer / side).powi(2))
        });
        if median > self.aim && self.has_coarser() {
            self.step += 1;
            self.times.clear();
        } else if finer.is_some_and(|time| time < self.aim.mul_f64(0.9)) {
            self.step -= 1;
            self.times.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MEMORY, Pace, TIME_OF_A_PICTURE};
    use std::time::Duration;

    /// Renders with a time linear in the pixels until the size settles.
    fn settle(pace: &mut Pace, time_of_largest: f64) -> u32 {
        for _ in 0..50 {
            let share = f64::from(pace.side(160)) / 160.0;
            pace.took(Duration::from_secs_f64(time_of_largest * share * share));
        }
        pace.side(160)
    }

    #[test]
    fn pictures_are_as_fine_as_time_allows() {
        let mut pace = Pace::of(false, 512);
        assert_eq!(settle(&mut pace, 0.02), 160);
        assert_eq!(settle(&mut pace, 0.15), 100);
        assert_eq!(settle(&mut pace, 100.0), 40, "the coarsest");
        assert_eq!(settle(&mut pace, 0.02), 160, "and back");
    }

    #[test]
    fn a_live_field_has_larger_pictures_in_less_time() {
        let small = Pace::of(true, 300);
        assert_eq!((small.is_live(), small.side(1000), small.side(100)), (true, 300, 100));
        assert_eq!((Pace::of(false, 512).is_live(), Pace::of(false, 512).side(1000)), (false, 160));
        // What is in time otherwise is too late.
        assert!(settle(&mut Pace::of(true, 160), 0.06) < 160);
        assert_eq!(settle(&mut Pace::of(false, 512), 0.06), 160);
    }

    /// A live field begins with what a processor draws in time, and ends where the device does.
    #[test]
    fn a_fast_device_draws_full_pictures() {
        let at = |pace: &Pace| pace.side(u32::MAX);
        let final_side = |full_side: u32, second_a_megapixel: f64| {
            let mut pace = Pace::of(true, full_side);
            assert!(at(&pace) <= 320, "at first {}", at(&pace));
            for _ in 0..50 {
                let pixels = f64::from(at(&pace)).powi(2) * 0.75e-6;
                pace.took(Duration::from_secs_f64(second_a_megapixel * pixels));
            }
            at(&pace)
        };
        assert_eq!(final_side(1024, 0.02), 1024);
        assert_eq!(final_side(512, 0.02), 512);
        assert_eq!(final_side(4000, 0.02), 1024, "the largest");
        assert_eq!(final_side(1024, 0.2), 384);
        assert_eq!(final_side(1024, 10.0), 128, "the coarsest");
        assert_eq!(final_side(100, 100.0), 50, "the coarsest of a small scene");
    }

    #[test]
    fn one_slow_picture_changes_nothing() {
        let mut pace = Pace::of(false, 512);
        for index in 0..10 * MEMORY {
            pace.took(if index % MEMORY == 1 { 50 * TIME_OF_A_PICTURE } else { TIME_OF_A_PICTURE / 2 });
        }
        assert_eq!(pace.side(160), 160);
    }
}
