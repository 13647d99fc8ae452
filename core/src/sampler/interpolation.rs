//! Integrals of the polynomial through known results, by which multistep methods step.

use super::MAX_RESULTS;
use crate::math::ln_ratio;

/// Numbers of a step in the logarithm of the level.
pub(super) type Row = [f32; MAX_RESULTS];

/// `integral over t in [0, 1] of h exp(-h (1 - t)) t^k`, for `k` of 0 to 3: the contribution to the state of a result
/// that grows like `t^k` along a step of length `h` in the logarithm of the level. `first` is the one for `k = 0`,
/// `1 - exp(-h)`, which the caller knows without a logarithm. They satisfy `m_k = 1 - k / h m_(k-1)`.
pub(super) fn exponential_moments(h: f32, first: f32) -> Row {
    let mut moments = [first, 0.0, 0.0, 0.0];
    if h > 2.0 {
        let mut k = 1;
        while k < MAX_RESULTS {
            moments[k] = 1.0 - k as f32 / h * moments[k - 1];
            k += 1;
        }
        return moments;
    }
    // Short steps: upwards the differences would cancel. Downwards an error shrinks by h / k each time, so that the
    // guess that this starts from does not matter.
    const FAR: usize = 14;
    let mut moment = h / (FAR as f32 + 1.0 + h);
    let mut k = FAR;
    while k > 1 {
        moment = h / k as f32 * (1.0 - moment);
        k -= 1;
        if k < MAX_RESULTS {
            moments[k] = moment;
        }
    }
    moments
}

/// The weight of each of `count` results at different `places` in the integral of the polynomial through them, with the
/// integrals of `t^k` given as `moments`. The sum is exactly the first moment to a rounding: a result that does not
/// change is taken as it is.
pub(super) fn weights(places: &Row, count: u32, moments: &Row) -> Row {
    let count = count as usize;
    let mut weights = [0.0; MAX_RESULTS];
    let mut rest = moments[0];
    let mut node = 1;
    while node < count {
        // Lagrange's polynomial, 1 at its own place and 0 at the others: coefficients of 1, t, t^2, t^3.
        let mut polynomial = [1.0, 0.0, 0.0, 0.0];
        let mut other = 0;
        while other < count {
            if other != node {
                let [a, b, c, d] = polynomial;
                let (place, gap) = (places[other], places[node] - places[other]);
                polynomial = [-place * a / gap, (a - place * b) / gap, (b - place * c) / gap, (c - place * d) / gap];
            }
            other += 1;
        }
        let [a, b, c, d] = polynomial;
        let weight = a * moments[0] + b * moments[1] + c * moments[2] + d * moments[3];
        weights[node] = weight;
        rest -= weight;
        node += 1;
    }
    weights[0] = rest;
    weights
}

/// Where the results at `levels` lie along a step of length `h` in the logarithm of the level that begins at `start`: 0
/// at its beginning, negative before.
pub(super) fn places(levels: &Row, count: u32, start: f32, h: f32) -> Row {
    let mut places = [0.0; MAX_RESULTS];
    let mut index = 0;
    while index < count as usize {
        places[index] = -ln_ratio(levels[index], start) / h;
        index += 1;
    }
    places
}
