//! The memory of devices that compute on the CPU in a way of their own: the CPU's.

/// Implements `Memory` for a type.
macro_rules! memory_of_the_cpu {
    ($Device:ty, |$device:ident| $name:expr) => {
        impl Memory for $Device {
            type Buffer<T: Element> = Vec<T>;

            fn name(&self) -> String {
                let $device = self;
                $name
            }

            fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, DeviceError> {
                Cpu.upload(values)
            }

            fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, DeviceError> {
                Cpu.zeros(count)
            }

            fn most_elements<T: Element>(&self) -> usize {
                Cpu.most_elements::<T>()
            }

            fn busy_elements(&self) -> usize {
                Cpu.busy_elements()
            }

            fn finish(&self) -> Result<(), DeviceError> {
                Cpu.finish()
            }

            fn kernel_times(&self) -> Vec<KernelTime> {
                Cpu.kernel_times()
            }

            fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, DeviceError> {
                Cpu.download(buffer)
            }
        }
    };
}
