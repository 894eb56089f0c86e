#include "common/parallel/gl_image.h"

#if defined(__CUDACC__)
#include "cuda/gl_image.h"
#endif

namespace trilha {

std::string GlImage::why_not() {
  std::string reason = why_unavailable(Backend::cuda);
#if defined(__CUDACC__)
  if (reason.empty()) reason = cuda::why_not_gl();
#endif
  return reason;
}

#if defined(__CUDACC__)
GlImage::GlImage(unsigned texture) : image_(cuda::register_image(texture), cuda::unregister_image) {}

void GlImage::write(const std::uint32_t* device_pixels, int width, int height, const Stream& stream) {
  cuda::write_image(image_.get(), device_pixels, width, height, stream.native());
}
#else
GlImage::GlImage(unsigned) { throw DeviceError(why_unavailable(Backend::cuda)); }

void GlImage::write(const std::uint32_t*, int, int, const Stream&) {}
#endif

}  // namespace trilha
