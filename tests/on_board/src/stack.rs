//! The stack below a point, painted before a call and read after it.

use core::arch::asm;
use core::ptr;

/// Bytes that are painted: more than any call here takes.
const PAINTED: usize = 4 * 1024;
/// Left alone: the caller's own frame and that of [`paint`].
const NEAR: usize = 32;
const PAINT: u32 = 0xA5A5_5A5A;

/// Paints the stack below the caller; returns where it stands.
#[inline(never)]
pub fn paint() -> usize {
    let top = pointer();
    for at in words(top) {
        // SAFETY: below the stack pointer lies memory of the stack that nothing uses; no interrupt is enabled.
        unsafe { ptr::write_volatile(at as *mut u32, PAINT) };
    }
    top
}

/// Bytes used below a point since it was painted, at least [`NEAR`].
#[inline(never)]
pub fn used(top: usize) -> u32 {
    // SAFETY: as in `paint`.
    let is_painted = |at: &usize| unsafe { ptr::read_volatile(*at as *const u32) } == PAINT;
    words(top).find(|at| !is_painted(at)).map_or(NEAR as u32, |deepest| (top - deepest) as u32)
}

/// The painted words, the deepest first.
fn words(top: usize) -> impl Iterator<Item = usize> {
    (top - PAINTED..top - NEAR).step_by(4)
}

fn pointer() -> usize {
    let top: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, sp", out(reg) top, options(nomem, nostack, preserves_flags)) };
    top & !7
}
