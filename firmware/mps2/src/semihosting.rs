//! The few semihosting calls in use (ARM IHI 0071): files of the host, and the end.

use core::arch::asm;
use core::ffi::CStr;

const SYS_OPEN: usize = 0x01;
const SYS_WRITE: usize = 0x05;
const SYS_READ: usize = 0x06;
const SYS_EXIT: usize = 0x18;

/// Mode `rb` of SYS_OPEN.
pub const READ: usize = 1;
/// Mode `wb` of SYS_OPEN.
pub const WRITE: usize = 5;

/// An open file of the host.
pub struct File(usize);

impl File {
    /// Opens a file; ends the run where it cannot.
    pub fn open(name: &CStr, mode: usize) -> Self {
        let block = [name.as_ptr() as usize, mode, name.to_bytes().len()];
        // SAFETY: the block and the name live through the call.
        match unsafe { call(SYS_OPEN, block.as_ptr() as usize) } {
            usize::MAX => exit(false),
            handle => Self(handle),
        }
    }

    /// The same file, for another owner.
    pub fn again(&self) -> Self {
        Self(self.0)
    }

    /// Fills `bytes`; ends the run when the host has closed the file.
    pub fn read(&mut self, bytes: &mut [u8]) {
        let mut done = 0;
        while let Some(rest) = bytes.get_mut(done..).filter(|rest| !rest.is_empty()) {
            let block = [self.0, rest.as_mut_ptr() as usize, rest.len()];
            // SAFETY: block and buffer live through the call, which writes at most `rest.len()` bytes.
            let missing = unsafe { call(SYS_READ, block.as_ptr() as usize) };
            if missing >= rest.len() {
                exit(false);
            }
            done += rest.len() - missing;
        }
    }

    /// Writes all of `bytes`; ends the run when the host does not take them.
    pub fn write(&self, bytes: &[u8]) {
        let block = [self.0, bytes.as_ptr() as usize, bytes.len()];
        // SAFETY: block and buffer live through the call, which reads them only.
        if unsafe { call(SYS_WRITE, block.as_ptr() as usize) } != 0 {
            exit(false);
        }
    }
}

/// Ends the emulator, with exit code 0 or 1.
pub fn exit(good: bool) -> ! {
    // ADP_Stopped_ApplicationExit, ADP_Stopped_RunTimeErrorUnknown
    let reason = if good { 0x20026 } else { 0x20023 };
    loop {
        // SAFETY: the call does not come back.
        unsafe { call(SYS_EXIT, reason) };
    }
}

/// # Safety
/// `argument` is what `operation` asks for: for all but SYS_EXIT, the address of a block that is valid through the call.
unsafe fn call(operation: usize, argument: usize) -> usize {
    let mut result = operation;
    // SAFETY: by the contract above; BKPT 0xAB returns its result in r0 and changes no other register.
    unsafe { asm!("bkpt 0xab", inout("r0") result, in("r1") argument, options(nostack)) };
    result
}
