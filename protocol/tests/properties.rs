//! Properties of all messages, all streams and all corruptions.

#![allow(clippy::unwrap_used, reason = "a test may")]

mod messages;

use messages::message;
use proptest::prelude::*;
use slamd_protocol::{
    DecoderCounters, Frame, FrameBuf, FrameDecoder, FrameEncoder, MAX_FRAME, MAX_PAYLOAD, Message, PayloadBuf,
    encode_frame,
};

/// A frame's type, sequence number and payload.
type Content = (u8, u8, Vec<u8>);

fn content(frame: Frame<'_>) -> Content {
    (frame.kind, frame.seq, frame.payload.to_vec())
}

fn decode(bytes: &[u8]) -> (Vec<Content>, DecoderCounters) {
    let mut decoder = FrameDecoder::new();
    let frames = bytes.iter().filter_map(|&byte| decoder.push(byte).map(content)).collect();
    (frames, decoder.counters())
}

/// The frames of a stream; neighbours differ in their sequence number.
fn frames(count: impl Into<proptest::collection::SizeRange>) -> impl Strategy<Value = Vec<FrameBuf>> {
    prop::collection::vec(message(), count).prop_map(|messages| {
        let mut encoder = FrameEncoder::new();
        messages.iter().map(|message| encoder.encode(message)).collect()
    })
}

fn contents(frames: &[FrameBuf]) -> Vec<Content> {
    frames.iter().flat_map(|frame| decode(frame).0).collect()
}

/// Bytes with frequent delimiters.
fn garbage(len: impl Into<proptest::collection::SizeRange>) -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(prop_oneof![9 => any::<u8>(), 1 => Just(0)], len)
}

proptest! {
    #[test]
    fn what_is_emitted_is_parsed(message in message()) {
        let mut payload = PayloadBuf::new();
        message.emit(&mut payload);
        prop_assert_eq!(Message::parse(message.kind(), &payload), Ok(message));
    }

    #[test]
    fn a_missing_byte_is_an_error_or_a_shorter_list_or_text(message in message()) {
        let mut payload = PayloadBuf::new();
        message.emit(&mut payload);
        if payload.pop().is_some() && !matches!(message, Message::Log(_)) {
            let error = Message::parse(message.kind(), &payload).unwrap_err().to_string();
            let got = format!("has {} bytes", payload.len());
            prop_assert!(error.contains(&got), "{}", error);
            if let Some((_, least)) = error.split_once("at least ") {
                prop_assert_eq!(least, (payload.len() + 1).to_string());
            }
        }
    }

    #[test]
    fn appended_fields_are_ignored(message in message(), appended in garbage(1..20)) {
        let mut payload = PayloadBuf::new();
        message.emit(&mut payload);
        let is_list = matches!(message, Message::Sonar(_) | Message::Geometry(_) | Message::Log(_));
        if !is_list && payload.try_extend_from_slice(&appended).is_ok() {
            prop_assert_eq!(Message::parse(message.kind(), &payload), Ok(message));
        }
    }

    #[test]
    fn parsing_arbitrary_bytes_never_panics(kind: u8, payload in garbage(0..300)) {
        if let Ok(message) = Message::parse(kind, &payload) {
            let mut again = PayloadBuf::new();
            message.emit(&mut again);
            prop_assert_eq!(Message::parse(kind, &again), Ok(message));
        }
    }

    #[test]
    fn parsing_arbitrary_bytes_of_known_types_never_panics(message in message(), payload in garbage(0..300)) {
        let _ = Message::parse(message.kind(), &payload);
    }

    #[test]
    fn any_payload_comes_through(kind: u8, seq: u8, payload in garbage(0..=MAX_PAYLOAD)) {
        let frame = encode_frame(kind, seq, &payload.iter().copied().collect());
        prop_assert_eq!(frame.len(), payload.len() + 8);
        let expected = DecoderCounters { frames: 1, ..DecoderCounters::default() };
        prop_assert_eq!(decode(&frame), (vec![(kind, seq, payload)], expected));
    }

    /// The decoder does not know about chunks; it may pause between any two bytes.
    #[test]
    fn chunking_does_not_matter(sent in frames(1..6), noise in garbage(0..40), at: prop::sample::Index,
                                cuts in prop::collection::vec(1..80usize, 1..50)) {
        let mut stream = sent.concat();
        let at = at.index(stream.len());
        stream.splice(at..at, noise);
        let mut decoder = FrameDecoder::new();
        let mut heard = Vec::new();
        let mut rest = stream.as_slice();
        for len in cuts.into_iter().cycle() {
            let (chunk, later) = rest.split_at(len.min(rest.len()));
            let mut next = decoder.clone();
            heard.extend(chunk.iter().filter_map(|&byte| next.push(byte).map(content)));
            decoder = next;
            rest = later;
            if rest.is_empty() {
                break;
            }
        }
        prop_assert_eq!((heard, decoder.counters()), decode(&stream));
    }

    /// A burst that does not touch the frame's delimiter costs only that frame.
    #[test]
    fn a_burst_inside_one_frame_costs_at_most_that_frame(sent in frames(3), from: prop::sample::Index,
                                                         to: prop::sample::Index, burst in garbage(0..300)) {
        let mut hit = sent[1].to_vec();
        let (from, to) = (from.index(hit.len()), to.index(hit.len()));
        hit.splice(from.min(to)..from.max(to), burst);
        let (heard, _) = decode(&[sent[0].as_slice(), &hit, &sent[2]].concat());
        let all = contents(&sent);
        prop_assert!(heard == all || heard == [all[0].clone(), all[2].clone()], "{:?}", heard);
    }

    /// A burst anywhere costs at most the frames that it touches, and the next one if it removed
    /// the last one's delimiter.
    #[test]
    fn a_burst_costs_at_most_the_frames_it_touches_and_one(sent in frames(4..8), from: prop::sample::Index,
                                                           len in 0..600usize, burst in garbage(0..600)) {
        let mut stream = sent.concat();
        let from = from.index(stream.len());
        let to = (from + len).min(stream.len());
        stream.splice(from..to, burst);
        let (heard, counters) = decode(&stream);

        let all = contents(&sent);
        let ends: Vec<usize> = sent.iter().scan(0, |end, frame| { *end += frame.len(); Some(*end) }).collect();
        let before = ends.iter().filter(|&&end| end <= from).count();
        let touched_until = 1 + ends.iter().filter(|&&end| end < to.max(from + 1)).count();
        let after = (touched_until + 1).min(all.len());
        prop_assert_eq!(&heard[..before], &all[..before]);
        prop_assert!(heard.ends_with(&all[after..]), "{:?} of {:?}", heard, all);
        prop_assert!(heard.iter().all(|frame| all.contains(frame)));
        prop_assert_eq!(counters.frames, heard.len() as u64);
    }

    #[test]
    fn after_any_garbage_the_next_but_one_frame_is_decoded(noise in garbage(0..3 * MAX_FRAME), sent in frames(2..4)) {
        let (heard, _) = decode(&[noise, sent.concat()].concat());
        prop_assert!(heard.ends_with(&contents(&sent)[1..]));
    }

    /// Every byte is counted, except idle delimiters.
    #[test]
    fn bytes_are_dropped_by_count(noise in garbage(0..3 * MAX_FRAME)) {
        let stream = [noise, vec![0]].concat();
        let (heard, counters) = decode(&stream);
        let good: usize = heard.iter().map(|(_, _, payload)| payload.len() + 8).sum();
        let idle = stream.iter().scan(0, |last, &byte| {
            let before = core::mem::replace(last, byte); Some(byte == 0 && before == 0)
        });
        let idle = idle.filter(|&idle| idle).count();
        prop_assert_eq!(counters.dropped_bytes, (stream.len() - good - idle) as u64);
    }

    #[test]
    fn garbage_without_a_delimiter_is_one_bad_frame(noise in prop::collection::vec(1..=255u8, MAX_FRAME..9 * MAX_FRAME)) {
        let (_, counters) = decode(&noise);
        let expected = DecoderCounters { malformed: 1, dropped_bytes: noise.len() as u64, ..DecoderCounters::default() };
        prop_assert_eq!(counters, expected);
    }
}
