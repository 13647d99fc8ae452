fn main() {
    let r =
        viewfuse_check::rates::measure_rates(&viewfuse_device::cpu::Cpu, 9, &viewfuse_job::progress::Silent).unwrap();
    println!("copy {} madd {}", r.copy_giga_bytes, r.multiply_add_giga_operations);
    for k in &r.kernels[..7] {
        println!("{:16} {:40} {:8.2} ms  share {:.3} {:?}", k.kernel, k.size, k.milliseconds, k.share, k.limit);
    }
}
