//! Any bytes as a trajectory file: read, compared with itself, written and read again, drawn.
#![no_main]

use hachi_trajectory::plot::Plot;
use hachi_trajectory::{Alignment, EvaluationOptions, RelativeDelta, evaluate, read, write};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(loaded) = read::from_reader(bytes) else {
        return;
    };
    let trajectory = loaded.trajectory;
    if let Some(stamps) = trajectory.stamps() {
        assert!(stamps.windows(2).all(|w| w[0] < w[1]));
    }

    let mut text = Vec::new();
    write::tum(&trajectory, &mut text).expect("a Vec takes everything");
    let again = read::from_reader(text.as_slice()).expect("what was written can be read");
    assert_eq!(again.trajectory.len(), trajectory.len());

    for alignment in [Alignment::None, Alignment::Se3, Alignment::Sim3] {
        let options = EvaluationOptions {
            alignment,
            relative_delta: RelativeDelta::Metres(1.0),
            ..EvaluationOptions::default()
        };
        if let Ok(evaluation) = evaluate(&trajectory, &again.trajectory, &options) {
            assert!(evaluation.ape.rmse.is_finite());
            let plot = Plot {
                title: "",
                subtitle: "",
                estimate: &evaluation.estimate,
                reference: Some(&trajectory),
                errors_m: Some(&evaluation.errors_m),
                links: &[],
            };
            assert!(!plot.to_svg().expect("there are poses").contains("NaN"));
        }
    }
});
