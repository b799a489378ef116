//! Readings that scatter more than usual: the noise is learnt and told, no sound ring is called faulty, and the stated error holds.

use slamd_core::ModelAspect;
use slamd_testkit::plain_drive::PlainDrive;

#[test]
fn a_ring_that_scatters_by_5_cm_is_no_worse_than_usual_and_its_noise_is_told() {
    let usual = PlainDrive { odometry_errors: 0.3, ..PlainDrive::through("flat", 2, 120.0) };
    let noisy = PlainDrive { noise_m: 0.05, ..usual.clone() };
    let (usual, noisy) = (usual.run(), noisy.run());
    println!(
        "{:.3} m with 5 cm, {:.3} m with 2 cm, wheels {:.3} m",
        noisy.rms_m(),
        usual.rms_m(),
        noisy.wheels_rms_m()
    );
    assert!(usual.models.is_empty(), "{:?}", usual.models);
    assert!(noisy.rms_m() < noisy.wheels_rms_m() && noisy.rms_m() < 0.1, "{:.3} m", noisy.rms_m());
    assert!(noisy.silent_s() <= 0.0, "{:.1} s", noisy.silent_s());
    let [told] = &noisy.models[..] else { panic!("{:?}", noisy.models) };
    assert_eq!(told.finding.aspect, ModelAspect::RangeNoise);
    assert!((0.035..0.065).contains(&told.finding.measured), "{told:?}");
}

#[test]
fn a_slow_and_noisy_ring_is_not_called_faulty() {
    let drive = PlainDrive {
        sensors: 12,
        sweep_s: 1.0,
        noise_m: 0.05,
        odometry_errors: 0.0,
        ..PlainDrive::through("home", 6, 200.0)
    };
    let outcome = drive.run();
    let mut faulty: Vec<usize> = outcome.faults.iter().map(|fault| fault.sensor).collect();
    faulty.sort_unstable();
    faulty.dedup();
    println!("{:.3} m, faulty {faulty:?}", outcome.rms_m());
    assert!(faulty.len() <= 4, "{:?}", outcome.faults);
    assert!(outcome.silent_s() <= 0.0, "{:.1} s", outcome.silent_s());
}
