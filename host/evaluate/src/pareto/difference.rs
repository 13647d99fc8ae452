//! The difference of pictures, from unrounded values: rounding to 8 bits would hide differences below half a level.

/// A difference over any number of pictures: squares are summed over all of them, in `f64`, in the order of the pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    squares: f64,
    count: u64,
    largest: f64,
}

impl Difference {
    /// Adds a picture and its reference: red, green and blue; opacity is not compared. For pictures of different length
    /// the difference is NaN.
    pub fn add(&mut self, picture: &[[f32; 4]], exact: &[[f32; 4]]) {
        if picture.len() != exact.len() {
            (self.squares, self.largest) = (f64::NAN, f64::NAN);
        }
        for (pixel, exact) in picture.iter().zip(exact) {
            for channel in 0..3 {
                let difference = (f64::from(pixel[channel]) - f64::from(exact[channel])).abs();
                self.squares += difference * difference;
                self.count += 1;
                // Once NaN, always NaN.
                if !(difference <= self.largest || self.largest.is_nan()) {
                    self.largest = difference;
                }
            }
        }
    }

    /// The largest difference of a channel whose range is 1; NaN if any value was NaN.
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// The root of the mean square, for channels whose range is 1: 0 of equal pictures, NaN if any value was NaN.
    pub fn root_mean_square(&self) -> f64 {
        if self.count == 0 { self.squares } else { (self.squares / self.count as f64).sqrt() }
    }

    /// Peak signal to noise ratio in decibels for a peak of 1: infinite for equal pictures, NaN if any value was NaN.
    pub fn psnr(&self) -> f64 {
        let error = self.root_mean_square();
        if error == 0.0 { f64::INFINITY } else { -20.0 * error.log10() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(picture: &[[f32; 4]], exact: &[[f32; 4]]) -> Difference {
        let mut difference = Difference::default();
        difference.add(picture, exact);
        difference
    }

    #[test]
    fn of_equal_pictures() {
        let equal = of(&[[0.1, 0.2, 0.3, 1.0]], &[[0.1, 0.2, 0.3, 0.0]]);
        assert_eq!((equal.psnr(), equal.largest(), equal.root_mean_square()), (f64::INFINITY, 0.0, 0.0));
    }

    #[test]
    fn of_one_channel_in_two_pictures() {
        let mut difference = of(&[[0.0; 4]], &[[0.0; 4]]);
        difference.add(&[[0.5, 0.25, 0.0, 0.0]], &[[0.0, 0.25, 0.0, 0.0]]);
        assert_eq!(difference.largest(), 0.5);
        // 0.25 over six channels.
        assert!((difference.psnr() - 10.0 * 24.0_f64.log10()).abs() < 1.0e-12);
    }

    #[test]
    fn what_is_no_number_shows() {
        let bad = [0.0, f32::NAN, 0.0, 1.0];
        for difference in
            [of(&[bad, [0.5; 4]], &[[0.0; 4]; 2]), of(&[[0.5; 4]; 2], &[bad, bad]), of(&[[0.0; 4]], &[[0.0; 4]; 2])]
        {
            assert!(difference.psnr().is_nan() && difference.largest().is_nan(), "{difference:?}");
        }
    }
}
