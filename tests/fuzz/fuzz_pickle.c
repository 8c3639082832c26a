/* libFuzzer target: pickles, alone and as whole files of tensors (plain,
 * PyTorch's older form, npy of objects). */
#include "lib/lab/import/pickle.h"
#include "tests/fuzz/read_tensors.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct error err;
    size_t used = 0;
    struct pickle *p = pickle_read(data, size, &used, &err);
    int bad = p && used > size;

    pickle_free(p);
    return read_tensors(data, size) || bad;
}
