//! Progress of a search by generations as a table.

use crate::optimisers::Generation;
use core::fmt::Write;

/// Table of best, best so far and mean fitness of every generation with 17 digits; values that are not finite are
/// empty.
pub fn fitness_csv(history: &[Generation]) -> String {
    let mut text = String::from("generation,best,best_so_far,mean\n");
    let number = |value: f64| if value.is_finite() { format!("{value:?}") } else { String::new() };
    for (generation, Generation { best, best_so_far, mean }) in (1..).zip(history) {
        let _ = writeln!(text, "{generation},{},{},{}", number(*best), number(*best_so_far), number(*mean));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_contains_every_generation_and_no_infinity() {
        let one = |best, mean| Generation { best, best_so_far: 170.0, mean };
        let csv = fitness_csv(&[one(300.0, f64::INFINITY), one(170.0, 900.0), one(180.0, 500.0)]);
        assert_eq!(csv.lines().nth(1), Some("1,300.0,170.0,"));
        assert_eq!(csv.lines().count(), 4);
    }
}
