! A library with the Bladed interface from Fortran: integral control of the generator speed; ends after a second
! where its input file says so.
subroutine discon(avrswap, avifail, accinfile, avcoutname, avcmsg) bind(c, name="DISCON")
   use, intrinsic :: iso_c_binding
   implicit none
   real(c_float), intent(inout) :: avrswap(*)
   integer(c_int), intent(inout) :: avifail
   character(kind=c_char), intent(in) :: accinfile(nint(avrswap(50)))
   character(kind=c_char), intent(in) :: avcoutname(nint(avrswap(51)))
   character(kind=c_char), intent(inout) :: avcmsg(nint(avrswap(49)))
   character(len=size(accinfile) - 1) :: name
   character(len=32), save :: mode = "law"
   real(c_float), save :: integral
   integer :: status
   interface
      subroutine abort_in_c() bind(c, name="abort")
      end subroutine
   end interface

   status = nint(avrswap(1))
   if (status == 0) then
      name = transfer(accinfile(1:len(name)), name)
      integral = avrswap(4)
      if (len(name) > 0) then
         open (unit=17, file=name, status="old")
         read (17, *) mode
         close (17)
      end if
      avifail = 1
      avcmsg = transfer("started in mode "//trim(mode)//c_null_char, avcmsg, size(avcmsg))
   end if
   if (status < 0) return
   if (status == 1) integral = integral + 1e-3*avrswap(3)*(avrswap(20) - avrswap(19))
   avrswap(47) = avrswap(22)
   avrswap(45) = integral
   avrswap(42:44) = integral
   if (avrswap(2) < 0.95) return
   if (mode == "stop") stop "no more wind"
   if (mode == "abort") then
      print *, "about to abort"
      call abort_in_c()
   end if
end subroutine
