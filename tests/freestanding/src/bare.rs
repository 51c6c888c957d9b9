//! What an operating system's library would bring: a way in, a way out, and two loops over bytes that the
//! compiler calls by name.

use core::arch::{asm, global_asm};

// The kernel leaves the number of words at the top of the stack, which a call must find aligned.
global_asm!(
    ".globl _start",
    "_start:",
    "mov rdi, [rsp]",
    "xor ebp, ebp",
    "and rsp, -16",
    "call {run}",
    "ud2",
    run = sym crate::run,
);

pub fn exit(code: i32) -> ! {
    // SAFETY: system call 60 takes the code and does not come back.
    unsafe { asm!("syscall", in("rax") 60, in("edi") code, options(noreturn, nostack)) }
}

/// Copies `count` bytes; in assembly, lest the compiler see a copy and call this function for it.
///
/// # Safety
/// Both must hold `count` bytes, none of them common.
#[unsafe(no_mangle)]
unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, count: usize) -> *mut u8 {
    // SAFETY: the caller's promise; the direction flag is clear at every call.
    unsafe {
        asm!("rep movsb", inout("rcx") count => _, inout("rdi") to => _, inout("rsi") from => _,
            options(nostack, preserves_flags));
    }
    to
}

/// Fills `count` bytes.
///
/// # Safety
/// `to` must hold `count` bytes.
#[unsafe(no_mangle)]
unsafe extern "C" fn memset(to: *mut u8, byte: i32, count: usize) -> *mut u8 {
    // SAFETY: as for `memcpy`.
    unsafe {
        asm!("rep stosb", inout("rcx") count => _, inout("rdi") to => _, in("eax") byte,
            options(nostack, preserves_flags));
    }
    to
}
