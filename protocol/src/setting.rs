//! temporary
use core::ops::RangeInclusive;
macro_rules! settings { ($($item:ident = $key:literal, $name:literal, $range:expr, $default:literal, $stop:literal;)*) => {
/// A setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Setting { $(#[doc = $name] $item = $key,)* }
impl Setting {
    /// All.
    pub const ALL: [Self; 12] = [$(Self::$item,)*];
    /// Key.
    #[must_use] pub const fn key(self) -> u8 { self as u8 }
    /// Name.
    #[must_use] pub const fn name(self) -> &'static str { match self { $(Self::$item => $name,)* } }
    /// Range.
    #[must_use] pub const fn range(self) -> RangeInclusive<i32> { match self { $(Self::$item => $range,)* } }
    /// Default.
    #[must_use] pub const fn default(self) -> i32 { match self { $(Self::$item => $default,)* } }
    /// Stop.
    #[must_use] pub const fn needs_stop(self) -> bool { match self { $(Self::$item => $stop,)* } }
    /// From key.
    #[must_use] pub fn from_key(key: u8) -> Option<Self> { Self::ALL.into_iter().find(|s| s.key() == key) }
    /// From name.
    #[must_use] pub fn from_name(name: &str) -> Option<Self> { Self::ALL.into_iter().find(|s| s.name() == name) }
}}}
settings! {
 Sensors=1,"sensors",1..=32,32,true; Groups=2,"groups",1..=8,4,true; SlotUs=3,"slot_us",10_000..=60_000,25_000,true;
 EncoderPeriodMs=4,"encoder_period_ms",5..=1000,20,false; TicksPerTurn=5,"ticks_per_turn",1..=10_000_000,1440,false;
 LeftReversed=6,"left_reversed",0..=1,0,false; RightReversed=7,"right_reversed",0..=1,0,false; WheelsSwapped=8,"wheels_swapped",0..=1,0,false;
 RingRadiusMm=9,"ring_radius_mm",0..=2000,150,false; HalfAngleCdeg=10,"half_angle_cdeg",0..=6000,1250,false; Clockwise=11,"clockwise",0..=1,0,false;
 MaxRangeMm=12,"max_range_mm",100..=6000,3000,true;
}
