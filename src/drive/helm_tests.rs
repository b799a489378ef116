use super::*;
use slamd_protocol::FrameDecoder;

const OWNER: Driver = Driver { number: 1, source: Drive::FROM_SOCKET };
const OTHER: Driver = Driver { number: 2, source: Drive::FROM_TOKEN };
const GOOD: Conditions = Conditions {
    is_streaming: true,
    has_motors: true,
    is_lost: false,
    is_doubted: false,
    has_wheels: true,
    motors: Some(MotionState::Idle),
};

fn ms(ms: u64) -> Timestamp {
    Timestamp::from_us(1_000 * ms)
}

fn wish(forward_m_s: f64, for_ms: u16) -> Order {
    let twist = Twist { forward_m_s, turn_rad_s: 0.0 };
    Order::Drive(Wish { twist, for_ms, is_autonomous: false })
}

fn helm() -> Helm {
    Helm::new(&Config::default())
}

fn drive(frame: &Bytes) -> Drive {
    let mut decoder = FrameDecoder::new();
    for &byte in frame {
        if let Some(frame) = decoder.push(byte)
            && let Ok(Message::Drive(drive)) = Message::parse(frame.kind, frame.payload)
        {
            return drive;
        }
    }
    panic!("no DRIVE in {frame:?}");
}

/// What is sent from `from` to `to`, in steps of a millisecond: time and speed of the left wheel.
fn sent(helm: &mut Helm, from: u64, to: u64, conditions: &Conditions) -> Vec<(u64, i16)> {
    (from..=to)
        .filter_map(|at| helm.tick(ms(at), conditions).map(|frame| (at, drive(&frame).speeds().left_mm_s())))
        .collect()
}

#[test]
fn nothing_is_sent_before_an_order_and_one_stop_after_it() {
    let mut helm = helm();
    assert_eq!(sent(&mut helm, 0, 5_000, &GOOD), []);
    let granted = helm.order(ms(5_000), OWNER, wish(9.0, 400), &GOOD).unwrap();
    assert!((granted.twist.forward_m_s - 0.2).abs() < 1e-12, "within the limits: {granted:?}");
    let sent = sent(&mut helm, 5_000, 9_000, &GOOD);
    let speeds: Vec<i16> = sent.iter().map(|(_, speed)| *speed).collect();
    assert_eq!(speeds, [20, 40, 60, 80, 100, 120, 140, 160, 0], "a ramp of 0.4 m/s², then a stop");
    assert_eq!(sent.last().unwrap().0, 5_400);
    assert_eq!(helm.deadline(), None);
}

#[test]
fn the_source_of_each_command_is_in_its_frame() {
    for driver in [OWNER, OTHER] {
        let mut helm = helm();
        helm.order(ms(0), driver, wish(0.1, 100), &GOOD).unwrap();
        let frames: Vec<Drive> =
            (0..300).filter_map(|at| helm.tick(ms(at), &GOOD)).map(|frame| drive(&frame)).collect();
        assert!(frames.len() == 3 && frames.iter().all(|drive| drive.source() == driver.source), "{frames:?}");
    }
}

#[test]
fn one_drives_until_the_lease_ends_or_somebody_stops() {
    let mut helm = helm();
    helm.order(ms(0), OWNER, wish(0.1, 500), &GOOD).unwrap();
    let refused = helm.order(ms(2_000), OTHER, wish(0.1, 500), &GOOD).unwrap_err();
    assert_eq!(refused, Refusal::Taken { by: "a client of the socket", left: Duration::from_secs(1) });
    assert!(helm.order(ms(2_500), OWNER, wish(0.1, 500), &GOOD).is_ok());
    assert!(helm.order(ms(5_400), OTHER, wish(0.1, 500), &GOOD).is_err(), "the lease was renewed");
    assert!(helm.order(ms(5_500), OTHER, wish(0.1, 500), &GOOD).is_ok(), "it is over");
    // The owner stops the other one, and drives.
    assert_eq!(helm.order(ms(5_600), OWNER, Order::Stop, &GOOD).unwrap().twist, Twist::default());
    assert_eq!(sent(&mut helm, 5_600, 5_700, &GOOD), [(5_600, 0)]);
    assert!(helm.order(ms(5_700), OWNER, wish(0.1, 500), &GOOD).is_ok());
}

#[test]
fn a_stop_is_sent_even_where_nothing_moves() {
    let mut helm = helm();
    helm.order(ms(0), OTHER, Order::Stop, &Conditions::default()).unwrap();
    assert_eq!(sent(&mut helm, 0, 1_000, &GOOD), [(0, 0)]);
}

#[test]
fn a_client_that_goes_stops_what_it_drove_and_nothing_else() {
    let mut helm = helm();
    helm.order(ms(0), OWNER, wish(0.1, 1_000), &GOOD).unwrap();
    assert_eq!(sent(&mut helm, 0, 20, &GOOD), [(0, 20)]);
    helm.order(ms(20), OTHER, Order::Leave, &GOOD).unwrap();
    assert_eq!(sent(&mut helm, 20, 60, &GOOD), [(50, 40)]);
    helm.order(ms(60), OWNER, Order::Leave, &GOOD).unwrap();
    assert_eq!(sent(&mut helm, 60, 2_000, &GOOD), [(60, 0)]);
    assert!(helm.order(ms(70), OTHER, wish(0.1, 100), &GOOD).is_ok(), "the helm is free");
}

#[test]
fn conditions_that_fail_refuse_and_stop() {
    let lost = Conditions { is_lost: true, ..GOOD };
    let cases = [
        (Conditions { is_streaming: false, ..GOOD }, Refusal::NotStreaming, false),
        (Conditions { has_motors: false, ..GOOD }, Refusal::NoMotors, false),
        (lost, Refusal::Lost, true),
        (Conditions { is_doubted: true, ..GOOD }, Refusal::Doubted, true),
        (Conditions { has_wheels: false, ..GOOD }, Refusal::Wheels, true),
    ];
    for (conditions, refusal, only_autonomous) in cases {
        for is_autonomous in [false, true] {
            let twist = Twist { forward_m_s: 0.1, turn_rad_s: 0.0 };
            let order = Order::Drive(Wish { twist, for_ms: 1_000, is_autonomous });
            let is_refused = is_autonomous || !only_autonomous;
            let answer = helm().order(ms(0), OWNER, order, &conditions);
            assert_eq!(answer.err(), Some(refusal.clone()).filter(|_| is_refused));
            // It fails while the robot drives.
            let mut helm = helm();
            helm.order(ms(0), OWNER, order, &GOOD).unwrap();
            assert_eq!(sent(&mut helm, 0, 20, &GOOD).len(), 1);
            let after = sent(&mut helm, 21, 60, &conditions);
            assert_eq!(after == [(21, 0)], is_refused, "{refusal:?} {is_autonomous} {after:?}");
        }
    }
    assert!(Conditions::default().permit(false).is_err(), "nothing is permitted by default");
}

#[test]
fn the_end_stops_what_moves() {
    let mut helm = helm();
    assert_eq!(helm.end(), None);
    helm.order(ms(0), OWNER, wish(0.1, 1_000), &GOOD).unwrap();
    helm.tick(ms(0), &GOOD);
    assert_eq!(drive(&helm.end().unwrap()).speeds(), WheelSpeeds::ZERO);
    assert_eq!((helm.end(), helm.tick(ms(100), &GOOD)), (None, None));
}
