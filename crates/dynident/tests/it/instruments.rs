//! Instruments from an external source, for example a simulated motion.
use crate::common::{Job, Motion, Random, Truth, format, header, repository, write_log};
use dynident::estimation::HausmanVerdict;
use dynident::identification::estimators::{EstimatorError, InstrumentSource};
use dynident::identify_with_instruments;
use dynident::recording::MotionBlock;

/// The true motion, like a perfect simulation.
struct TrueMotion {
    motion: Motion,
    begun: usize,
}

impl InstrumentSource for TrueMotion {
    fn begin(&mut self, _log: usize) -> Result<(), EstimatorError> {
        self.begun += 1;
        Ok(())
    }

    fn motion(&mut self, measured: &MotionBlock, instruments: &mut MotionBlock) -> Result<(), EstimatorError> {
        let size = measured.rows * measured.joints;
        for values in [&mut instruments.q, &mut instruments.dq, &mut instruments.ddq] {
            values.resize(size, 0.0);
        }
        for row in 0..measured.rows {
            let [q, dq, ddq] = self.motion.at(measured.first_time_s + row as f64 / measured.rate_hz);
            for joint in 0..measured.joints {
                let place = joint * measured.rows + row;
                (instruments.q[place], instruments.dq[place], instruments.ddq[place]) =
                    (q[joint], dq[joint], ddq[joint]);
            }
        }
        Ok(())
    }
}

#[test]
fn a_simulated_motion_undoes_the_bias_of_noisy_positions() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Truth::near(&repository("robots/ur10.urdf"), 0.2, false);
    let mut random = Random(5);
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), (250.0, 20.0), &header(6), |q, tau| {
        let q: Vec<f64> = q.iter().map(|q| q + 1e-3 * random.normal()).collect();
        q.into_iter().chain(tau.iter().map(|t| t + 0.1 * random.normal())).collect()
    });
    let text = format!(
        "robot.file = {:?}\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter.factor = 4\ndrive.friction = \"stated\"\n{}",
        repository("robots/ur10.urdf").display().to_string(),
        format(6).replace("method = \"central-differences\", order = 8", "method = \"butterworth\", cutoff_hz = 30.0")
    );
    let job = Job::new(folder.path(), &text);
    let values = truth.base_values(&job.robot());
    // By default Dynident would use instruments from the log.
    let plain = Job::new(folder.path(), &("estimator.method = \"weighted\"\n".to_owned() + &text)).identify();
    let mut source = TrueMotion { motion: Motion::new(6, 1), begun: 0 };
    let found = identify_with_instruments(&job.study, &job.path, &Job::options(1), &mut source).unwrap();
    assert_eq!((source.begun, &found.result.method.estimator[..]), (1, "instrumental"));
    let noise = found.result.noise_in_regressor.as_ref().unwrap();
    assert_eq!(noise.hausman.verdict, HausmanVerdict::RejectLeastSquares, "{:?}", noise.hausman);
    assert_eq!(noise.instrument_cutoff_hz, None);
    // Errors in units of the instruments' error bars are about one if these are valid. Noise of 1e-3 rad at 30 Hz is
    // about 7 rad/s² of acceleration, several times that of the motion: least squares underestimates most inertias.
    let error = |found: &dynident::IdentificationOutcome, bars: &[f64]| {
        let sum: f64 = (0..values.len()).map(|i| ((found.estimate.values[i] - values[i]) / bars[i]).powi(2)).sum();
        (sum / values.len() as f64).sqrt()
    };
    let bars = &found.estimate.std;
    let (by_instruments, by_least_squares) = (error(&found, bars), error(&plain, bars));
    // 54 squares with mean one: their root mean square is within 0.6 to 1.4 by four standard deviations; the jackknife
    // is conservative.
    assert!(by_instruments < 1.6, "{by_instruments}");
    assert!(by_least_squares > 3.0 * by_instruments, "{by_least_squares} and {by_instruments}");
}
