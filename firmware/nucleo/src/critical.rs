//! Critical sections that leave the sample interrupt on.

use critical_section::RawRestoreState;

/// A section keeps main from itself, which one thread needs nothing for. The one interrupt takes no section and touches nothing that
/// a section guards (embassy's set-up, the log): `cargo xtask firmware boards` checks that no instruction masks it.
struct MainAlone;
critical_section::set_impl!(MainAlone);

// SAFETY: as said above; main is the only one to enter.
unsafe impl critical_section::Impl for MainAlone {
    unsafe fn acquire() -> RawRestoreState {
        core::sync::atomic::compiler_fence(core::sync::atomic::Ordering::SeqCst);
    }

    unsafe fn release(_: RawRestoreState) {
        core::sync::atomic::compiler_fence(core::sync::atomic::Ordering::SeqCst);
    }
}
