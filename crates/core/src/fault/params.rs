//! The constants of fault detection.

use std::f64::consts::PI;

/// The constants of fault detection, for sensors and for encoders.
///
/// "First version" means: set by hand in the first version, not measured since. "Overall" means: no single measurement; together
/// the values give the detection rates, latencies and false alarms of `docs/sensor-faults.md`
/// (`cargo xtask sensor-faults --seeds 101-120 --seconds 80`). A reason that follows from the value alone
/// (two spacings of a ring) is all that the record holds. LLR is a natural log-likelihood ratio.
///
/// | name | value | unit | how chosen | what breaks when it is wrong |
/// |---|---|---|---|---|
/// | `calm_m2` | 0.002 | m² | overall; squared Cauchy weight, so that one wild sensor of eight does not become the first component | larger: a noisy sensor hides in the component; smaller: turns leave residuals everywhere |
/// | `sure_part` | 0.65 | of the range | first version; farther off, walls drop out one by one | larger: false "saturated" in large rooms; smaller: saturated sensors are found late |
/// | `wheel_base_m` | 0.3 | m | a guess; turns need no more here | evidence per sweep scales with it |
/// | `lever_m` | 0.5 | m | first version; a turn moves what is this far away | larger: a slow turn makes a sensor look stuck |
/// | `passed_while_stirred` | 3 | | first version; readings change only by the part of the motion along their beams | without wheels: saturated sensors are found late or wrongly |
/// | `max_change_m` | 0.1 | m | first version; a longer jump is another surface | larger: a standing robot without wheels seems to drive |
/// | `neighbour_aside_rad` | 46° | rad | one sensor spacing of a ring of eight (45°), and a margin | smaller: a ring of eight has no neighbours; larger: neighbours see other walls |
/// | `neighbour_agree_m` | 0.4 | m | first version | larger: doors give false alarms; smaller: neighbours say nothing in corners |
/// | `moved_m` | 0.012 | m | first version; a shorter step shows nothing new | smaller: a standing robot's sensors become stuck |
/// | `declare` | 6 | LLR | first version; in Wald's SPRT, ln((1 − β) / α), it means an α of about 0.0025 | lower: false alarms; higher: latency |
/// | `clear` | 0 | LLR | the point where both hypotheses are as probable | lower: a repaired sensor stays ignored |
/// | `floor` | −2 | LLR | first version; bounds the memory of good sweeps | lower: a change is noticed late |
/// | `ceiling` | 12 | LLR | twice `declare` | higher: a repaired sensor stays ignored; near `declare`: the state toggles |
/// | `max_recurrences` | 3 | | first version; the ceiling doubles this many times at most | higher: a loose contact blinds a sensor for minutes |
/// | `forgiven_sweeps` | 600 | sweeps | one minute at 10 sweeps per second | lower: a loose contact toggles the state |
/// | `no_answer` | 3 | LLR | overall; two sweeps declare, latency "missing" is 0.3 s | lower: latency |
/// | `blanked` | 0.75 | LLR | first version; crosstalk blanks any sensor now and then | higher: false "missing" while the board blanks |
/// | `answer` | −2 | LLR | first version; a healthy sensor answers, if only that it hears nothing | nearer to 0: single gaps add up |
/// | `silent_by_map` | 1.3 | LLR | overall; a fifth of the log of the share of silent sweeps, because sweeps share the map's error | higher: a wrong map accuses sensors |
/// | `silent_at_wall` | 11 | LLR per m | overall; healthy sensors are seldom silent for more than half a metre of wall | higher: doors and mirrors give false alarms |
/// | `close_rad` | 25° | rad | neighbours this close leave no gap: two spacings of 32 sensors (22.5°), and a margin | larger: sparse rings give false alarms |
/// | `max_silent` | 0.9 | LLR | first version; the most that one such sweep adds | higher: one fast sweep past a door counts too much |
/// | `heard` | −3 | LLR | first version; a saturated sensor never hears | nearer to 0: healthy sensors in open rooms become saturated |
/// | `jump` | 1.5 | LLR | overall; most readings of a noisy sensor jump, one of thirty of a healthy one, a few in a row in clutter | higher: clutter gives false "noisy" |
/// | `no_jump` | −1.3 | LLR | as `jump` | nearer to 0: clutter gives false "noisy" |
/// | `half_jump` | −0.2 | LLR | an outlier spoils the three blocks that hold it; a step between two surfaces leaps once | positive: single outliers become "noisy" |
/// | `unexplained_m` | 0.05 | m | first version; root of the PCA residual, 2 cm of range noise leave 0.8 cm | smaller: turns look like noise |
/// | `leap_m` | 0.15 | m | first version; where the robot moves farther between two sweeps, leaps say nothing | smaller: driving looks like noise; larger: weak noise is missed |
/// | `leap_sigmas` | 4.5 | sigma | by hand: three of the difference of two readings, and a margin; below `leap_m` up to 0.033 m of noise | smaller: a ring of cheap sensors is noisy; larger: weak noise is missed |
/// | `unexplained_sigmas` | 1.0 | sigma | by hand: PCA leaves 0.4 of it; below `unexplained_m` up to 0.05 m of noise | as `leap_sigmas` |
/// | `unexplained_share` | 0.5 | of the motion | by hand: a robot that moves by 0.3 m from sweep to sweep does so along a curve, not a line | smaller: slow sweeps look noisy |
/// | `about_to_declare` | 3 | LLR | half of `declare` | lower: two or three cluttered beams suspend the verdicts; higher: the first third is declared before |
/// | `max_apparent` | 2 | sensors | by hand: so few may break at once in the smallest ring | lower: a ring of three declares none; higher: small rings are outvoted |
/// | `back_m` | 0.05 | m | first version; a sensor that alternates between two surfaces comes back this close | larger: a noisy sensor seems to alternate |
/// | `short_silence_sweeps` | 3 | sweeps | the PCA block, whose residual a silence spoils | larger: doors count as jumps |
/// | `repeated` | 0.35 | LLR | overall; latency "stuck" is 2.3 s | higher: a robot that drives along a wall has stuck sensors |
/// | `changed` | −6 | LLR | `declare`: one change disproves it | nearer to 0: a stuck sensor that was never stuck |
/// | `same_m` | 4e−4 | m | less than the echo timer can tell apart | larger: a drive along a wall looks stuck; smaller: jitter hides a stuck sensor |
/// | `encoder_step_m` | 0.15 | m | a wrong wheel then turns the robot by more than the angle between two sensors | smaller: nothing to compare; larger: latency |
/// | `encoder_max_sweeps` | 40 | sweeps | first version; 4 s at 10 sweeps per second | larger: people and doors change the scene |
/// | `min_rolled_m` | 0.05 | m | first version | smaller: noise decides on a wheel's direction |
/// | `dead_share` | 0.02 | of the other wheel | first version; a loose wire still gives a few counts | larger: a pivot on one wheel looks dead |
/// | `rolled_shares` | −1.4 … 1.4 | of the other wheel | covers pivots and curves in ten steps; 0 is what the encoder says | too coarse: a dead encoder stays unknown |
/// | `encoder_gain` | 3 | | as many endpoints as are independent, estimated | higher: false alarms |
/// | `encoder_max_added` | 3 | LLR | `encoder_declare` then takes four steps | higher: one bad step declares |
/// | `encoder_declare` | 12 | LLR | no false alarm on whole encoders (`docs/sensor-faults.md`) | lower: false alarms; higher: latency |
/// | `encoder_suspect` | 3 | LLR | one full step | lower: mapping pauses often; higher: wrong poses enter the map |
/// | `encoder_counted_steps` | 4 | steps | first version | lower: a loose wire toggles the state |
/// | `endpoint_aside_rad` | 23° | rad | half a sensor spacing of a ring of eight (22.5°), and a margin | smaller: a ring of eight compares nothing |
/// | `endpoint_sigma_m` | 0.08 | m | first version; range noise and the width of the cone | smaller: clutter decides; larger: latency |
/// | `max_cost` | 4 | | first version; an endpoint at 2.8 sigma and beyond costs this | larger: a hidden wall decides |
/// | `min_compared` | 4 | endpoints | first version | smaller: two endpoints decide |
#[expect(missing_docs, reason = "the table describes each field")]
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    pub calm_m2: f64,
    pub sure_part: f64,
    pub wheel_base_m: f64,
    pub lever_m: f64,
    pub passed_while_stirred: f64,
    pub max_change_m: f64,
    pub neighbour_aside_rad: f64,
    pub neighbour_agree_m: f64,
    pub moved_m: f64,
    pub declare: f64,
    pub clear: f64,
    pub floor: f64,
    pub ceiling: f64,
    pub max_recurrences: f64,
    pub forgiven_sweeps: f64,
    pub no_answer: f64,
    pub blanked: f64,
    pub answer: f64,
    pub silent_by_map: f64,
    pub silent_at_wall: f64,
    pub close_rad: f64,
    pub max_silent: f64,
    pub heard: f64,
    pub jump: f64,
    pub no_jump: f64,
    pub half_jump: f64,
    pub unexplained_m: f64,
    pub leap_m: f64,
    pub leap_sigmas: f64,
    pub unexplained_sigmas: f64,
    pub unexplained_share: f64,
    pub about_to_declare: f64,
    pub max_apparent: usize,
    pub back_m: f64,
    pub short_silence_sweeps: u32,
    pub repeated: f64,
    pub changed: f64,
    pub same_m: f64,
    pub encoder_step_m: f64,
    pub encoder_max_sweeps: u64,
    pub min_rolled_m: f64,
    pub dead_share: f64,
    pub rolled_shares: [f64; 10],
    pub encoder_gain: f64,
    pub encoder_max_added: f64,
    pub encoder_declare: f64,
    pub encoder_suspect: f64,
    pub encoder_counted_steps: u32,
    pub endpoint_aside_rad: f64,
    pub endpoint_sigma_m: f64,
    pub max_cost: f64,
    pub min_compared: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            calm_m2: 0.002,
            sure_part: 0.65,
            wheel_base_m: 0.3,
            lever_m: 0.5,
            passed_while_stirred: 3.0,
            max_change_m: 0.1,
            neighbour_aside_rad: 46.0 / 180.0 * PI,
            neighbour_agree_m: 0.4,
            moved_m: 0.012,
            declare: 6.0,
            clear: 0.0,
            floor: -2.0,
            ceiling: 12.0,
            max_recurrences: 3.0,
            forgiven_sweeps: 600.0,
            no_answer: 3.0,
            blanked: 0.75,
            answer: -2.0,
            silent_by_map: 1.3,
            silent_at_wall: 11.0,
            close_rad: 25.0 * PI / 180.0,
            max_silent: 0.9,
            heard: -3.0,
            jump: 1.5,
            no_jump: -1.3,
            half_jump: -0.2,
            unexplained_m: 0.05,
            leap_m: 0.15,
            leap_sigmas: 4.5,
            unexplained_sigmas: 1.0,
            unexplained_share: 0.5,
            about_to_declare: 3.0,
            max_apparent: 2,
            back_m: 0.05,
            short_silence_sweeps: 3,
            repeated: 0.35,
            changed: -6.0,
            same_m: 4e-4,
            encoder_step_m: 0.15,
            encoder_max_sweeps: 40,
            min_rolled_m: 0.05,
            dead_share: 0.02,
            rolled_shares: [-1.4, -1.1, -0.8, -0.5, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4],
            encoder_gain: 3.0,
            encoder_max_added: 3.0,
            encoder_declare: 12.0,
            encoder_suspect: 3.0,
            encoder_counted_steps: 4,
            endpoint_aside_rad: 23.0 / 180.0 * PI,
            endpoint_sigma_m: 0.08,
            max_cost: 4.0,
            min_compared: 4.0,
        }
    }
}
