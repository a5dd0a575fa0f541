//! Genetic algorithm of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* ("the
//! paper" below): binary coding, roulette wheel selection by 1/H, one-point crossover, bit mutation.

use super::{Objective, OptimiserError, Progress, Watch, check_bounds, evaluate_all, setting};
use dynident_model::sample::Random;
use serde::{Deserialize, Serialize};

/// Settings of [`binary_genetic()`]. The defaults are those of *Iterative Identification of Robot Dynamic Parameters
/// Based on Logistic Function*, section 2.2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BinaryGeneticSettings {
    /// Number of bits per variable, 1 to 52. Default 20.
    pub bits: usize,
    /// Number of individuals, even and at least 2. Default 40.
    pub population: usize,
    /// Number of evaluated generations. Default 500.
    pub generations: usize,
    /// Crossover probability of a pair of parents. Default 0.5.
    pub crossover: f64,
    /// Probability with which every bit flips in every generation. The paper does not state whether its 0.01 is per
    /// bit or per individual; here it is per bit. Default 0.01.
    pub mutation: f64,
    /// Whether the best individual of a generation is copied to the next (elitism). The paper does not mention
    /// elitism. Default false.
    pub elite: bool,
    /// Seed of the random numbers. Default 0.
    pub seed: u64,
}

impl Default for BinaryGeneticSettings {
    fn default() -> Self {
        Self { bits: 20, population: 40, generations: 500, crossover: 0.5, mutation: 0.01, elite: false, seed: 0 }
    }
}

impl BinaryGeneticSettings {
    /// Checks the range of every setting.
    ///
    /// # Errors
    /// [`OptimiserError::Setting`] with the first invalid one.
    pub fn validate(&self) -> Result<(), OptimiserError> {
        setting("bits", self.bits as f64, (1..=52).contains(&self.bits), "between 1 and 52")?;
        let even = (2..=1_000_000).contains(&self.population) && self.population.is_multiple_of(2);
        setting("population", self.population as f64, even, "an even number from 2 to 1,000,000")?;
        let generations = (1..=10_000_000).contains(&self.generations);
        setting("generations", self.generations as f64, generations, "between 1 and 10,000,000")?;
        setting("crossover", self.crossover, (0.0..=1.0).contains(&self.crossover), "between 0 and 1")?;
        setting("mutation", self.mutation, (0.0..=1.0).contains(&self.mutation), "between 0 and 1")
    }
}

/// Objective values of one generation of the search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Generation {
    /// Lowest objective in this generation.
    pub best: f64,
    /// Lowest objective in this and all earlier generations.
    pub best_so_far: f64,
    /// Mean of the finite objectives of this generation.
    pub mean: f64,
}

/// Result of [`binary_genetic()`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BinaryGeneticResult {
    /// Best point of all generations.
    pub best: Vec<f64>,
    /// Objective of the best point; infinite if no individual had a finite objective.
    pub value: f64,
    /// One entry per generation, in order.
    pub history: Vec<Generation>,
    /// Number of evaluations of the objective.
    pub evaluations: usize,
    /// Whether the callback stopped the search before the last generation.
    pub stopped: bool,
}

/// Minimises a positive `objective` H over the box `bounds` by the binary genetic algorithm.
///
/// A variable is a binary number k of `bits` bits, most significant first, `x = lower + (upper - lower) k / (2^bits -
/// 1)`. An individual is the sequence of the bits of its variables. In every generation parents are drawn by roulette
/// wheel, with probability proportional to 1/H. Consecutive parents are crossed at one random place with probability
/// `crossover`, and every bit of the children flips with probability `mutation`. The children replace all parents
/// (except the best one with `elite`).
///
/// Candidates are evaluated in parallel; the result depends only on the seed. A candidate whose objective is infinite
/// or undefined is drawn only if all candidates are like this.
///
/// # Errors
/// A setting out of range, or a range that is empty or infinite.
pub fn binary_genetic(
    objective: impl Fn(&[f64]) -> f64 + Sync,
    bounds: &[[f64; 2]],
    settings: &BinaryGeneticSettings,
    watch: &mut Watch<'_>,
) -> Result<BinaryGeneticResult, OptimiserError> {
    evolved(&objective, bounds, settings, watch)
}

/// [`binary_genetic()`], compiled once for all objectives.
fn evolved(
    objective: &Objective<'_>,
    bounds: &[[f64; 2]],
    settings: &BinaryGeneticSettings,
    watch: &mut Watch<'_>,
) -> Result<BinaryGeneticResult, OptimiserError> {
    settings.validate()?;
    check_bounds(bounds, true)?;
    let mut random = Random::new(settings.seed);
    let digits = settings.bits * bounds.len();
    let mut individuals: Vec<Vec<bool>> =
        (0..settings.population).map(|_| (0..digits).map(|_| random.bits() >> 63 == 1).collect()).collect();
    let mut result = BinaryGeneticResult {
        best: decode(&individuals[0], bounds, settings.bits),
        value: f64::INFINITY,
        history: Vec::with_capacity(settings.generations),
        evaluations: 0,
        stopped: false,
    };
    for generation in 1..=settings.generations {
        let points: Vec<Vec<f64>> = individuals.iter().map(|i| decode(i, bounds, settings.bits)).collect();
        let values = evaluate_all(objective, &points);
        result.evaluations += values.len();
        let fittest = (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        if values[fittest] < result.value {
            result.value = values[fittest];
            result.best.clone_from(&points[fittest]);
        }
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let mean = if finite.is_empty() { f64::INFINITY } else { finite.iter().sum::<f64>() / finite.len() as f64 };
        result.history.push(Generation { best: values[fittest], best_so_far: result.value, mean });
        let progress = Progress {
            best: &result.best,
            value: result.value,
            violation: 0.0,
            iteration: generation,
            evaluations: result.evaluations,
        };
        if watch(&progress).is_break() {
            result.stopped = generation < settings.generations;
            break;
        }
        individuals = children(&individuals, &values, fittest, settings, &mut random);
    }
    Ok(result)
}

fn decode(individual: &[bool], bounds: &[[f64; 2]], bits: usize) -> Vec<f64> {
    let largest = ((1_u64 << bits) - 1) as f64;
    individual
        .chunks_exact(bits)
        .zip(bounds)
        .map(|(digits, &[lower, upper])| {
            let number = digits.iter().fold(0_u64, |number, &digit| 2 * number + u64::from(digit));
            // Gives exactly the end of the range for the largest number.
            (lower + (upper - lower) * (number as f64 / largest)).min(upper)
        })
        .collect()
}

fn children(
    parents: &[Vec<bool>],
    values: &[f64],
    fittest: usize,
    settings: &BinaryGeneticSettings,
    random: &mut Random,
) -> Vec<Vec<bool>> {
    let mut cumulated = 0.0;
    let mut wheel: Vec<f64> = values
        .iter()
        .map(|value| {
            cumulated += 1.0 / value;
            cumulated
        })
        .collect();
    if !(cumulated > 0.0 && cumulated.is_finite()) {
        // All individuals get the same probability if all objectives are infinite or one is not positive.
        wheel = (1..=values.len()).map(|count| count as f64).collect();
    }
    let total = wheel[wheel.len() - 1];
    let mut next: Vec<Vec<bool>> = (0..parents.len())
        .map(|_| {
            let place = random.uniform(0.0, total);
            parents[wheel.partition_point(|&end| end <= place).min(parents.len() - 1)].clone()
        })
        .collect();
    for pair in next.chunks_exact_mut(2) {
        let digits = pair[0].len();
        if digits > 1 && random.uniform(0.0, 1.0) < settings.crossover {
            let cut = 1 + (random.uniform(0.0, (digits - 1) as f64) as usize).min(digits - 2);
            let (first, second) = pair.split_at_mut(1);
            first[0][cut..].swap_with_slice(&mut second[0][cut..]);
        }
    }
    for individual in &mut next {
        for digit in individual {
            *digit ^= random.uniform(0.0, 1.0) < settings.mutation;
        }
    }
    if settings.elite {
        next[0].clone_from(&parents[fittest]);
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::ops::ControlFlow;

    fn bowl(x: &[f64]) -> f64 {
        1.0 + (x[0] - 0.3).powi(2) + (x[1] + 2.0).powi(2)
    }
    const BOX: [[f64; 2]; 2] = [[-5.0, 5.0], [-4.0, 4.0]];

    #[test]
    fn digits_span_the_range_with_both_ends() {
        let bounds = [[0.1, 3.0]];
        assert_eq!(decode(&[false; 20], &bounds, 20), [0.1]);
        assert_eq!(decode(&[true; 20], &bounds, 20), [3.0]);
        let mut one = [false; 20];
        one[19] = true;
        // One step of the grid, up to rounding of the two numbers.
        assert!((decode(&one, &bounds, 20)[0] - 0.1 - 2.9 / 1_048_575.0).abs() < 1e-15);
    }

    #[test]
    fn finds_the_bowl_and_reports_its_history() {
        for elite in [false, true] {
            let settings = BinaryGeneticSettings { elite, generations: 200, seed: 5, ..Default::default() };
            let result = binary_genetic(bowl, &BOX, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
            assert_eq!((result.history.len(), result.evaluations), (200, 8000));
            // The nearest of 8000 random points in 80 square units is within about 0.06; the search must not be worse.
            assert!(result.value < 1.01, "{}", result.value);
            assert_eq!(bowl(&result.best), result.value);
            let mut lowest = f64::INFINITY;
            for generation in &result.history {
                lowest = lowest.min(generation.best);
                assert_eq!(generation.best_so_far, lowest);
                assert!(generation.best <= generation.mean);
                assert!(!elite || generation.best == lowest);
            }
        }
    }

    #[test]
    fn only_the_seed_decides_on_any_number_of_threads() {
        let run = |threads, seed| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let settings = BinaryGeneticSettings { seed, generations: 30, ..Default::default() };
            pool.install(|| binary_genetic(bowl, &BOX, &settings, &mut |_| ControlFlow::Continue(())).unwrap())
        };
        assert_eq!(run(1, 3), run(3, 3));
        assert_ne!(run(1, 3), run(1, 4));
    }

    #[test]
    fn the_callback_ends_it() {
        let mut calls = 0;
        let mut third = |progress: &Progress<'_>| {
            calls += 1;
            assert_eq!((progress.iteration, progress.evaluations), (calls, 40 * calls));
            if calls == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let result = binary_genetic(bowl, &BOX, &BinaryGeneticSettings::default(), &mut third).unwrap();
        assert!(result.stopped);
        assert_eq!(result.history.len(), 3);
    }

    #[test]
    fn an_objective_without_numbers_ends_too() {
        let settings = BinaryGeneticSettings { generations: 5, ..Default::default() };
        let result = binary_genetic(|_| f64::NAN, &BOX, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(result.value, f64::INFINITY);
        assert!(result.best.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn wrong_settings_are_named() {
        let go = |bounds: &[[f64; 2]], settings: &BinaryGeneticSettings| {
            binary_genetic(bowl, bounds, settings, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string()
        };
        let odd = BinaryGeneticSettings { population: 7, ..Default::default() };
        assert_eq!(go(&BOX, &odd), "setting `population` is 7; it must be an even number from 2 to 1,000,000");
        let error = go(&[[0.0, 1.0], [2.0, f64::NAN]], &BinaryGeneticSettings::default());
        assert!(error.starts_with("variable 1: cannot search the range 2 to NaN"), "{error}");
    }
}
