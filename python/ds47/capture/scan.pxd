# The types with which Cython compiles scan.py. Plain Python never reads this file.
cimport cython

cdef const unsigned char* _UUIDS
cdef unsigned int _BIG_1, _BIG_2, _LITTLE_1, _LITTLE_2, _TAIL_1, _TAIL_2
cdef unsigned int _IPV4, _PROFINET, _LLDP, _UDP, _PNIO_PORT, _ENHANCED
cdef long _ETHERNET, _RAW, _RAW_IPV4, _SLL, _SLL2
cdef Py_ssize_t _MAX_FRAME, _BATCH

cdef unsigned int _u16(const unsigned char* data, Py_ssize_t at) noexcept nogil

cdef unsigned int _u32(const unsigned char* data, Py_ssize_t at, bint big) noexcept nogil

cdef bint _is_tag(unsigned int kind) noexcept nogil

@cython.locals(at=Py_ssize_t, kind="unsigned int")
cdef bint _is_rt(const unsigned char* data, Py_ssize_t start, Py_ssize_t captured) noexcept nogil

@cython.locals(first="unsigned int", second="unsigned int", have=Py_ssize_t, uuid=Py_ssize_t, at=Py_ssize_t,
               one_to_four=bint)
cdef bint _is_pnio(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, bint cut, bint on_port
) noexcept nogil

@cython.locals(at=Py_ssize_t)
cdef Py_ssize_t _network(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type
) noexcept nogil

cdef unsigned int _kind(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t at, long link_type
) noexcept nogil

@cython.locals(at=Py_ssize_t, udp=Py_ssize_t, kind="unsigned int", on_port=bint)
cdef bint _relevant(
    const unsigned char* data, Py_ssize_t start, Py_ssize_t end, long link_type, Py_ssize_t original
) noexcept nogil

cdef class PcapScan:
    cdef public Py_ssize_t position, frames
    cdef bint _big
    cdef Py_ssize_t _header
    cdef long _link_type
    cdef object _swapped, _layout, _record, _runs

    @cython.locals(view="const unsigned char*", found=list, big=bint, header=Py_ssize_t, link_type=long,
                   position=Py_ssize_t, number=Py_ssize_t, last=Py_ssize_t, start=Py_ssize_t,
                   captured=Py_ssize_t, original=Py_ssize_t, seconds="unsigned int",
                   fraction="unsigned int")
    cdef list _compiled(self, data, Py_ssize_t end)

cdef class PcapngScan:
    cdef public Py_ssize_t position, frames
    cdef public list links
    cdef bint _big
    cdef object _swapped, _block, _layout, _word, _runs

    @cython.locals(view="const unsigned char*", found=list, big=bint, links=list, known=Py_ssize_t,
                   position=Py_ssize_t, number=Py_ssize_t, last=Py_ssize_t, total=Py_ssize_t,
                   interface=Py_ssize_t, captured=Py_ssize_t, original=Py_ssize_t, start=Py_ssize_t,
                   link_of=Py_ssize_t, link_type=long, high="unsigned int", low="unsigned int")
    cdef list _compiled(self, data, Py_ssize_t end)
