//! What the link, the board and the estimator permit.

use super::order::Refusal;
use crate::source::session::Session;
use slamd_core::link::{Link, LinkState};
use slamd_core::{EncoderState, ModelState, Pipeline, SessionState};
use slamd_protocol::MotionState;

/// What decides whether the robot may be driven now. The default permits nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conditions {
    /// Sweeps arrive, and the board has said who it is.
    pub is_streaming: bool,
    /// The board obeys DRIVE.
    pub has_motors: bool,
    /// The pose is uncertain.
    pub is_lost: bool,
    /// The robot differs from its configuration.
    pub is_doubted: bool,
    /// Both encoders are healthy.
    pub has_wheels: bool,
    /// What the motors do, by the board's last MOTION.
    pub motors: Option<MotionState>,
}

impl Conditions {
    /// Those of a live session.
    #[must_use]
    pub fn of(link: &Link, session: &Session) -> Self {
        let is_streaming = link.state() == LinkState::Streaming;
        Self::of_robot(session.pipeline(), session.state(), is_streaming)
    }

    /// Those of a robot whose sweeps arrive, or do not.
    #[must_use]
    pub fn of_robot(pipeline: &Pipeline, state: &SessionState, is_streaming: bool) -> Self {
        let hello = pipeline.board().hello();
        Self {
            is_streaming: is_streaming && hello.is_some(),
            has_motors: hello.is_some_and(slamd_protocol::Hello::drives),
            is_lost: state.is_lost() || state.estimate().is_none(),
            is_doubted: state.models().iter().any(|event| event.state == ModelState::Doubted),
            has_wheels: state.encoders() == [EncoderState::Healthy; 2],
            motors: pipeline.motion().map(|motion| motion.state),
        }
    }

    /// Whether a command may be sent.
    ///
    /// # Errors
    /// Why it may not.
    pub fn permit(&self, is_autonomous: bool) -> Result<(), Refusal> {
        if !self.is_streaming {
            Err(Refusal::NotStreaming)
        } else if !self.has_motors {
            Err(Refusal::NoMotors)
        } else if is_autonomous && self.is_lost {
            Err(Refusal::Lost)
        } else if is_autonomous && self.is_doubted {
            Err(Refusal::Doubted)
        } else if is_autonomous && !self.has_wheels {
            Err(Refusal::Wheels)
        } else {
            Ok(())
        }
    }
}
