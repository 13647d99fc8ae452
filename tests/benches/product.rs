//! Matrix products of the CPU device as shares of what the machine can do: `cargo bench -p viewfuse-tests --bench product`.
//!
//! The peak is measured in the same run: multiplications fused with additions on registers alone, on every core, with
//! the widest instructions there are. Both are measured in turns, because what else a machine does, and how fast its
//! clock may run, changes from second to second: a share is that of a product to the peak just before it. The `best`
//! columns compare the fastest of all rounds, which on a busy machine is nearer to the truth.
//!
//! Sizes are `rows x inner x columns`: first the one to compare libraries at, then those of a render of the published
//! PixelNeRF from 3 sources, as they come (rectified inputs, residual).

use std::hint::black_box;
use std::time::{Duration, Instant};
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Layer, LayerShape};
use viewfuse_kernels::network::linear::LinearBlock;

const ROUNDS: usize = 40;
/// Sums that are computed side by side: enough that none waits for its own last step (latency 4, two a cycle).
const SUMS: usize = 12;

/// Multiplies and adds this many times for each of [`SUMS`] vectors.
type Loop = fn(u32) -> f32;

/// The loop of the widest instructions that this machine has, their name and how many lanes they have.
fn widest() -> Option<(&'static str, usize, Loop)> {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the instructions are there.
            #[allow(unsafe_code)]
            return Some(("AVX-512", 16, |steps| unsafe { x86::avx512(steps) }));
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the instructions are there.
            #[allow(unsafe_code)]
            return Some(("AVX2 with FMA", 8, |steps| unsafe { x86::avx2(steps) }));
        }
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        // SAFETY: the instructions are there.
        #[allow(unsafe_code)]
        return Some(("NEON", 4, |steps| unsafe { arm::neon(steps) }));
    }
    None
}

/// A loop whose sums tend to 1: no number becomes so small that arithmetic with it is slow.
macro_rules! fused_loop {
    ($name:ident, $features:literal, $splat:ident, $add:ident, $multiply_add:expr, $first:expr) => {
        #[target_feature(enable = $features)]
        pub(super) fn $name(steps: u32) -> f32 {
            let (factor, summand) = ($splat(black_box(0.9)), $splat(black_box(0.1)));
            // Different ones, or one would do for all.
            let mut sums: [_; SUMS] = std::array::from_fn(|sum| $splat(sum as f32));
            for _ in 0..steps {
                for sum in &mut sums {
                    *sum = $multiply_add(*sum, factor, summand);
                }
            }
            let all = sums.into_iter().reduce(|a, b| $add(a, b)).unwrap_or(summand);
            $first(all)
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{SUMS, black_box};
    use std::arch::x86_64::*;

    fused_loop!(avx512, "avx512f", _mm512_set1_ps, _mm512_add_ps, _mm512_fmadd_ps, _mm512_cvtss_f32);
    fused_loop!(avx2, "avx2,fma", _mm256_set1_ps, _mm256_add_ps, _mm256_fmadd_ps, _mm256_cvtss_f32);
}

#[cfg(target_arch = "aarch64")]
mod arm {
    use super::{SUMS, black_box};
    use std::arch::aarch64::*;

    fused_loop!(neon, "neon", vdupq_n_f32, vaddq_f32, |sum, factor, summand| vfmaq_f32(summand, sum, factor), |sum| {
        vgetq_lane_f32::<0>(sum)
    });
}

/// A product and what it works on.
struct Product {
    name: String,
    block: LinearBlock,
    inputs: Vec<f32>,
    layer: Layer<Cpu>,
    residual: Option<Vec<f32>>,
    outputs: Vec<f32>,
}

impl Product {
    fn new(row_count: u32, inner_count: u32, column_count: u32, relu_inputs: u32, has_residual: bool) -> Product {
        let numbers = |count: u32| (0..count).map(|i| (i * 7919 % 1000) as f32 / 1000.0 - 0.5).collect::<Vec<f32>>();
        let block = LinearBlock { row_count, inner_count, column_count, relu_inputs, ..LinearBlock::default() };
        let what = match (relu_inputs, has_residual) {
            (0, false) => "",
            (0, true) => ", residual",
            (_, false) => ", rectified inputs",
            (_, true) => ", rectified inputs, residual",
        };
        let [inner, columns] = [inner_count, column_count].map(|count| count as usize);
        let shape = LayerShape { inner_count: inner, column_count: columns, has_wide_images: false };
        let layer = Layer::new(&Cpu, &shape, &numbers(inner_count * column_count), &numbers(column_count))
            .expect("the CPU cannot fail");
        Product {
            name: format!("{row_count}x{inner_count}x{column_count}{what}"),
            block,
            inputs: numbers(row_count * inner_count),
            layer,
            residual: has_residual.then(|| numbers(row_count * column_count)),
            outputs: numbers(row_count * column_count),
        }
    }

    /// Billions of operations a second.
    fn rate(&mut self) -> f64 {
        let Product { block, inputs, layer, residual, outputs, .. } = self;
        let operations =
            2.0 * f64::from(block.row_count) * f64::from(block.inner_count) * f64::from(block.column_count);
        // About as long as the peak is measured.
        let repeats = (3.0e9 / operations).clamp(1.0, 200.0) as u32;
        let time = timed(|| {
            for _ in 0..repeats {
                Cpu.linear(block, inputs, &layer.weights, &layer.bias, residual.as_ref(), outputs)
                    .expect("the CPU cannot fail");
            }
            black_box(&outputs[..]);
        });
        f64::from(repeats) * operations / time.as_secs_f64() / 1.0e9
    }
}

fn timed(work: impl FnOnce()) -> Duration {
    let start = Instant::now();
    work();
    start.elapsed()
}

/// Billions of operations a second of all cores together.
fn peak(lanes: usize, run: Loop) -> f64 {
    // Ten milliseconds: starting the threads takes nothing beside it.
    const STEPS: u32 = 4_000_000;
    let threads = rayon::current_num_threads();
    let time = timed(|| {
        rayon::broadcast(|_| black_box(run(STEPS)));
    });
    (2 * lanes * SUMS * threads) as f64 * f64::from(STEPS) / time.as_secs_f64() / 1.0e9
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let Some((instructions, lanes, run)) = widest() else {
        println!("no loop for the fused instructions of this machine: there is no peak to compare with");
        return;
    };
    let mut products = [
        Product::new(4096, 512, 512, 0, false),
        Product::new(2046, 512, 512, 1, false),
        Product::new(2046, 512, 512, 0, true),
        Product::new(682, 512, 512, 1, false),
        Product::new(2046, 42, 512, 0, false),
        Product::new(682, 512, 4, 1, false),
    ];
    let mut peaks = Vec::new();
    let mut rates = vec![Vec::new(); products.len()];
    for _ in 0..ROUNDS {
        for (product, rates) in products.iter_mut().zip(&mut rates) {
            let peak = peak(lanes, run);
            peaks.push(peak);
            rates.push((product.rate(), peak));
        }
    }
    let best = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let threads = rayon::current_num_threads();
    println!("{:42} {:>8} {:>8} {:>8} {:>8}", "GFLOP/s", "median", "share", "best", "share");
    println!(
        "{:42} {:8.0} {:>8} {:8.0}",
        format!("{instructions}, {threads} threads"),
        median(peaks.clone()),
        "",
        best(&peaks)
    );
    for (product, rates) in products.iter().zip(rates) {
        let (own, shares): (Vec<f64>, Vec<f64>) = rates.iter().map(|(rate, peak)| (*rate, rate / peak)).unzip();
        let best_rate = best(&own);
        println!(
            "{:42} {:8.0} {:7.0}% {best_rate:8.0} {:7.0}%",
            product.name,
            median(own),
            100.0 * median(shares),
            100.0 * best_rate / best(&peaks)
        );
    }
}
